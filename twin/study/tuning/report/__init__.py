"""What is told of a tuning: as JSON, as figures, as one page."""
