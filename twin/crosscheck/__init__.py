"""Cross-check: comparison of the engine, the Lagrangian and Pinocchio."""
