"""Measurement space analysis, section 4 of the paper: which poses to measure, and how to divide a space."""

from truearm.planning.accessibility import (
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
from truearm.planning.configurations import Configuration
from truearm.planning.pool import Pool, PoolOptions, draw_pool, needed_pool
from truearm.planning.spaces import CartesianSpace, JointSpace, Space, SphericalSpace

__all__ = [
    "CartesianSpace",
    "Configuration",
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
    "accessible",
    "draw_pool",
    "either",
    "needed_pool",
]
