"""What joins the parts of a loop: the functions of its users, and the wires between its two sides."""
