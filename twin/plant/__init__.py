"""Plant: physics step, two rotor engines, friction."""
