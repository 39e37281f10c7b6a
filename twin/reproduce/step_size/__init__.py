"""Error that the physics step makes, for every law and scenario."""
