"""What a run comes to in a number or three: what a metric is, gathered as the run goes, and their names."""
