"""What is kept of a study while it runs: its journal, who writes it, and what it is of."""
