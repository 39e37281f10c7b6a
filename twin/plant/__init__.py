"""The plant: two engines, drive, friction, disturbance."""
