"""The verbs of the `spheretwin` command, one a file."""
