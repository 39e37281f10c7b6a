"""Scene of the actuator in 3D: meshes, static parts and motion."""
