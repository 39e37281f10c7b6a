"""Tuning: a sampler proposes gains, and trials evaluate them on the rows of a study."""
