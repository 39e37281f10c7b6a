"""Control laws, and the allocation of torque to coil currents."""
