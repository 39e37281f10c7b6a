"""What a controller does about faults: groups left out, a detector of them, and a watchdog."""
