"""How recordings are laid out: what stands where under which name, in which colours."""
