"""Export of the plant and of the control tick as C99, and of the plant as a functional mock-up unit (FMU)."""
