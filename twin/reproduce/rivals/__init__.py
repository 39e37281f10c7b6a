"""Comparison of the laws: gains of one search with the same budget for all, results under other seeds."""
