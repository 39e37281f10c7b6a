"""Configuration of a session: resolved scenario, its warnings, parameters of the plant step."""
