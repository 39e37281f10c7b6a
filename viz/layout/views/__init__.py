"""Layouts of a recording, each for one question about the run."""
