"""A bench at work: its parts, commands taken in their turn, chunks run, and what is recorded and shown."""
