"""The control laws, one a file, and their names."""
