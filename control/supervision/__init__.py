"""Reaction of the controller to faults: enabled groups, fault detector and watchdog."""
