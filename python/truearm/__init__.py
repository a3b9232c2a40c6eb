"""Robot arm calibration with Denavit-Hartenberg parameters that vary over the workspace."""
