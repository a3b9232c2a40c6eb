"""Measurement space analysis, section 4 of the paper: which poses to measure, and how to divide a space."""

from truearm.planning.accessibility import (
    AboveFloor,
    InBox,
    InCone,
    InSphere,
    JointLimits,
    KeepOut,
    LeastContactAngle,
    Places,
    Rule,
    accessible,
    either,
)
from truearm.planning.choosing import Choice, ChoiceOptions, choose
from truearm.planning.configurations import Configuration
from truearm.planning.dividing import DividedSpace, DivisionOptions, divide_space
from truearm.planning.folding import ClearOfItself
from truearm.planning.pool import Pool, PoolOptions, draw_pool, needed_pool
from truearm.planning.spaces import CartesianSpace, JointSpace, Space, SphericalSpace
from truearm.planning.workspace import Workspace

__all__ = [
    "AboveFloor",
    "CartesianSpace",
    "Choice",
    "ChoiceOptions",
    "ClearOfItself",
    "Configuration",
    "DividedSpace",
    "DivisionOptions",
    "InBox",
    "InCone",
    "InSphere",
    "JointLimits",
    "JointSpace",
    "KeepOut",
    "LeastContactAngle",
    "Places",
    "Pool",
    "PoolOptions",
    "Rule",
    "Space",
    "SphericalSpace",
    "Workspace",
    "accessible",
    "choose",
    "divide_space",
    "draw_pool",
    "either",
    "needed_pool",
]
