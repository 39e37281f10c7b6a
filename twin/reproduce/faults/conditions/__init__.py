"""What is run: sets of groups, parts that all share, the ways to meet them, and the cases that they make."""
