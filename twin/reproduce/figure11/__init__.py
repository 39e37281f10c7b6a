"""Figure 11: the prototype's tilt under each law, and what brings each to the error that the paper shows."""
