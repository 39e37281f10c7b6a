"""Rates from sampled angles, one way a file, and their names: on the near side of the wires."""
