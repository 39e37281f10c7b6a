"""What is shown in a terminal: tables and progress."""
