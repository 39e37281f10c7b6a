"""Reference trajectories, one shape a file, and their names."""
