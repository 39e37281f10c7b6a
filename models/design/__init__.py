"""Offline design: field integrals, the torque curve, the torque within reach, and what judges them."""
