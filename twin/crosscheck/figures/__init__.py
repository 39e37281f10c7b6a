"""What is drawn of the cross-check, one figure a file."""
