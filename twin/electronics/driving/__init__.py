"""The way out: from commands to currents in the coils, one stage a file."""
