"""Meshes of the actuator, generated from its numbers."""
