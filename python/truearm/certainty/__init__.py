"""How well a calibration is known: standard deviations and errors, exact and bounded."""
