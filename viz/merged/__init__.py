"""Several runs in one Rerun recording: each under its own path, on one timeline, under one layout."""
