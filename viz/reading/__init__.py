"""Recordings read back, whole or as a killed process left them."""
