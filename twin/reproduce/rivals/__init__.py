"""The laws as fronts: error against variation of the currents, each over a family of its own gains."""
