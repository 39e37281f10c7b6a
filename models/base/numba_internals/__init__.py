"""Private APIs of numba; each file states its reasons, `pyproject.toml` bounds the versions."""
