"""Electronics: drive stages from the law to the coils, sensor stages from the joints to the law."""
