"""Visualisation: recordings, live views, figures, pages and tables."""
