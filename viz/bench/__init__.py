"""Browser page of the bench: it shows and drives the running twin."""
