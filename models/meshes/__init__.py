"""The meshes of the actuator, made from its numbers."""
