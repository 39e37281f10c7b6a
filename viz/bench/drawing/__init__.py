"""The actuator in few triangles, for a browser without a GPU."""
