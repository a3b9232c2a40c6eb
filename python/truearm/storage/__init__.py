"""How a calibration is kept in a file, and summed up."""
