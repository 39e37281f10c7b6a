"""What the actuator is, and what it says: geometry, dynamics, magnetics, signals."""
