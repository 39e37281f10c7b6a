"""Fault injection: faults of a scenario, their schedule, and their effects on the stages."""
