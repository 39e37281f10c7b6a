"""What is plotted beside the telemetry, one quantity a file, computed from its rows."""
