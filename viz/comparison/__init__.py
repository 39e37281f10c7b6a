"""Runs held beside each other: what is drawn of each, under which name and in which colour."""
