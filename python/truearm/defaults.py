"""Numbers that a function and a command have in common when nothing is stated; nothing heavy is imported."""

from typing import Final

HOLDOUT: Final = 0.3
"""Part of the rows that is held out."""

SEED: Final = 7
"""Seed of splits and draws of rows."""

THERE_AND_BACK: Final = "there-and-back"
"""Order in which planned poses are measured."""

LARGEST_MM: Final = 5.0
"""Shift of the tool that a correction may be."""

LARGEST_DEG: Final = 1.0
"""Turn of the tool that a correction may be."""

LARGEST_JOINT_DEG: Final = 3.0
"""Change of a revolute joint's reading that a correction may be."""

LARGEST_STD_MM: Final = 1.0
"""Standard deviation of the tool's position that a correction may have."""

LEAST_SPACING_MM: Final = 10.0
"""Way between two waypoints that are inserted on a line, at the least."""

RAMP_S: Final = 1.0
"""Time of the ramp from no correction to the whole one."""

HOLD_S: Final = 0.1
"""How long the last correction is held where there is no good one."""

DEADLINE_S: Final = 0.05
"""Longest time between two set-points."""
NO_DRIFT: Final = "none"
"""What the option `drift` says where set-ups are taken to stand still."""
