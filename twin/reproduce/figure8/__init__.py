"""Figure 8: the nutation under each law, as angles, as errors and as the path of the shaft tip."""
