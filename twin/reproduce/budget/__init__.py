"""What each part of the prototype costs each law on the tilt, switched on alone and all together."""
