"""Columns of the telemetry that not every run has, one stage a file, and their list."""
