"""Figures of how laws track: errors over a condition and over time, angles, and paths of the shaft."""
