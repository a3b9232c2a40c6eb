"""The paper's experiment, section 7, on the virtual cell through the real measurement process."""
