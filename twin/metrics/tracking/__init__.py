"""How well the rotor followed, one metric a file."""
