"""What the paper shows, run again: one experiment a file or folder, and the page of what they found."""
