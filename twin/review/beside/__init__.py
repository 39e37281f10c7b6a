"""Runs beside each other: named apart, merged into one recording, drawn, and their figures subtracted."""
