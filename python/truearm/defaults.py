"""Numbers that a function and a command have in common when nothing is stated; nothing heavy is imported."""

from typing import Final

HOLDOUT: Final = 0.3
"""Part of the rows that is held out."""

SEED: Final = 7
"""Seed of splits and draws of rows."""

THERE_AND_BACK: Final = "there-and-back"
"""Order in which planned poses are measured."""

LINK_RADIUS_MM: Final = 40.0
"""Half the thickness of an arm's links where nothing else is known: that of a small arm's forearm."""

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

FIRST_TARGET: Final = 1
"""Measured target at which errors are judged."""

MODEL: Final = "variable"
"""Model that predicts."""

ROBUST: Final = "none"
"""Loss of the constant fit."""

DRIFT: Final = "auto"
"""Whether drift of the set-ups is taken out."""

NO_DRIFT: Final = "none"
"""What the option `drift` says where set-ups are taken to stand still."""

FRAME: Final = "free"
"""Whether the frames of set-ups are unknown."""

DEGREE: Final = 2
"""Degree of the memberships."""

OFFSET_DEG: Final = 1.0
"""Standard deviation of the change of a revolute joint's offset before an update."""

TOOL_MM: Final = 5.0
"""Standard deviation of the change of each coordinate of the target on the tool before an update."""

LEVEL: Final = 0.01
"""Share of the unchanged arms of which an update may say that something changed."""

PAPER_FIGURES: Final = ("6", "7", "8", "paths", "noise", "cmac")
"""Figures of the paper that its study draws."""

PAPER_REGIONS: Final = 85
"""Into how many regions the experiment of the paper divides the space."""

PAPER_POSES: Final = 20
"""Poses that the paper measures in each region to identify it."""

EXPERIMENT_SPEED: Final = 1000.0
"""How fast the virtual clock of that experiment runs."""
