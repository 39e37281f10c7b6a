"""What a recording holds beside the telemetry to be looked at, at the rates that the eye needs."""
