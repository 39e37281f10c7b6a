"""Link to a machine: frames, transports, the twin as a machine, and our controller on a machine."""
