"""Telemetry of a run: signals, tables and files; and time series of a user."""
