"""Runs looked at again from their files alone: facts, figures, events, differences, tolerances, columns."""
