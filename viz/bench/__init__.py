"""The bench's page: the twin that runs, seen and driven from a browser."""
