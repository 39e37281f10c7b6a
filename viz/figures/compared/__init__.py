"""Figures of runs beside each other, drawn with Matplotlib: a colour and a dash a run."""
