"""Analysis of runs from their files: reports, events, differences, tolerances, columns."""
