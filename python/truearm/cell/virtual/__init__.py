"""The virtual cell: devices that speak the real protocols over pseudo-terminals and TCP, with a virtual arm.

A process for each device; what they share, where arm and table are and the clock, stands in a small file in
memory.
"""
