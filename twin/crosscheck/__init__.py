"""The reasons to trust the twin: engine, Lagrangian and Pinocchio held against each other."""

STATES = 10_000
"""Random states at which the dynamics are compared, unless told otherwise."""
