"""The shapes of reference trajectories, one a file."""
