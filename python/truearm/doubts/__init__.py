"""What may be wrong with measurements, and with what was made of them: each suspicion has a module."""
