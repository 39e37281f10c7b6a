"""Closed loop: its stages, inputs and columns, its assembly, and blocks of many runs."""
