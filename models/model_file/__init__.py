"""What a compiled model file holds, looked up by name, within bounds, and refused where it is not there."""
