"""Engines of a sweep: on what its rows run, one file each, and their list."""
