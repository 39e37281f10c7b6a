"""Studies: many runs over all cores, interruptible and resumable, with one table as the result."""
