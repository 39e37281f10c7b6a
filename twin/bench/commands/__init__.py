"""What a bench can be told: a file for each kind of command, and a registry with a row for each command."""
