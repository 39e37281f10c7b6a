"""Rerun's web viewer, served by this process to this machine alone."""
