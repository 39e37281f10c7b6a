"""What fails, and when: faults that a scenario plans, and what each does to the stage that it strikes."""
