"""The actuator as it is drawn in 3D: its meshes, where they are, and what is drawn beside them."""
