"""The plant: engine, drive, disturbance."""
