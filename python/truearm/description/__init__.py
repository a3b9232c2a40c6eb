"""Descriptions of arms: files of our own, URDF, Denavit-Hartenberg rows from axes."""
