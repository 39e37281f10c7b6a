"""Where in a recording what is drawn in 3D stands."""

WORLD = "world"
COILS = f"{WORLD}/coils"
MOVING = ("outer_ring", "inner_ring", "rotor")
TIP = f"{WORLD}/shaft_tip"
TIP_DESIRED = f"{WORLD}/shaft_tip_desired"
