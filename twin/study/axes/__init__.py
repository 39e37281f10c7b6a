"""Axes of a study: how the values of a field are chosen, one way a file, and their list."""
