"""Reference trajectories: what one is, how its corners are rounded, and the names of the shapes."""
