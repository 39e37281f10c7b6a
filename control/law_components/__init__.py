"""What several laws are made of: gains, the sliding surface, the fuzzy approximator."""
