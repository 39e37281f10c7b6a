"""Comparison of runs in one recording: bodies, lines, names and colours of each."""
