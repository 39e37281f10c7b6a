"""Tuning: gains that a sampler proposes, judged by a study's rows, as trials that are kept and gone on with."""
