"""Layout of recordings: views, plots, ranges, names and colours."""
