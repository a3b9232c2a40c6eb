"""Robot programs: reading them, correcting their targets, and writing them with nothing else changed."""
