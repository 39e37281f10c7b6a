"""What a run says of itself, and series of the user's: signals, tables, and the files they are kept in."""
