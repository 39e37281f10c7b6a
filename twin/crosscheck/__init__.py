"""The reasons to trust the twin: engine, Lagrangian and Pinocchio held against each other."""
