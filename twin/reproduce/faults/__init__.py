"""The nutation with parts that fail in mid-flight: open coil groups, sensors, the supply, the controller."""
