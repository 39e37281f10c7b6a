"""Offline design of magnets and coils: field integrals, torque curve, torque map and their checks."""
