"""Figures of runs, checks and torque maps, drawn with Matplotlib."""
