"""The closed loop, and everything on the far side of the controller."""
