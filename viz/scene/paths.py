"""Where in a recording what is drawn in 3D stands."""

WORLD = "world"
COILS = f"{WORLD}/coils"
MOVING = ("outer_ring", "inner_ring", "rotor")
TORQUES = f"{WORLD}/torques"
FAILURE = f"{WORLD}/failure"
FAILURE_TEXT = f"{FAILURE}/text"
AXES = f"{WORLD}/axes"
ROTOR_AXES = f"{WORLD}/rotor/axes"
PAYLOAD = f"{WORLD}/rotor/payload"
CURRENT_SCALE = f"{WORLD}/current_scale"
