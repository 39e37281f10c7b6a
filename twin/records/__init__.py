"""What a run leaves: facts for its followers, the record in its file, its summary, its replay."""
