"""One hinge with friction: the formulas of each way to compute it, and its runs."""
