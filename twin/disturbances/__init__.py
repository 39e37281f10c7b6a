"""What acts on the hinges beside the coils, one kind a file, and their names."""
