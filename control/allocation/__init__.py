"""From a torque to group currents within their limit, one way a file, and their names."""
