"""What the motion took of coils and amplifiers, one metric a file."""
