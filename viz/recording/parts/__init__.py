"""What a recording holds of a run: one part a file, each recorded by itself."""
