"""What a run comes to in a number or three: one metric a file, gathered while the run goes on."""
