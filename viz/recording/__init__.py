"""A run as a Rerun recording, written to a file or watched live."""
