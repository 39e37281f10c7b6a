"""The actuator about a pose at rest, as linear control has it."""
