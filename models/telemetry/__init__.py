"""What a run says of itself: signals, tables, and the file they are streamed to."""
