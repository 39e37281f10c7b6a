"""A page whose plots are zoomed, read at a cursor and switched run by run, with all it needs in itself."""
