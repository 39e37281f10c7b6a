"""Records of a run: provenance, and replay from its telemetry."""
