"""Tuning: gains that a sampler proposes, judged by the rows of a study, as trials that are kept."""
