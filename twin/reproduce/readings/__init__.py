"""How the control law (41) may be read, and which reading comes nearest to the printed errors."""
