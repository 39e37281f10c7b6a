"""Actuator: geometry, dynamics, magnetics and telemetry."""
