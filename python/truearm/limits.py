"""Bounds of a correction, in the units that people think in."""

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from truearm.defaults import LARGEST_DEG, LARGEST_JOINT_DEG, LARGEST_MM, LARGEST_STD_MM
from truearm.errors import UsageError
from truearm.kinds import check_number, settle
from truearm.robot import Robot
from truearm.units import MM_PER_METRE, MRAD_PER_RAD, RADIANS_PER_DEGREE

if TYPE_CHECKING:
    from truearm._core import CorrectorBounds

Task = Literal["pose", "axis", "position"]
TASKS: Final = ("pose", "axis", "position")


@dataclass(frozen=True)
class Limits:
    """What a correction may be; None switches a bound off.

    Attributes:
        largest_joint_deg: Change of a revolute joint's reading.
        largest_slide_mm: Change of a prismatic joint's reading.
        largest_mm: Shift of the tool.
        largest_deg: Turn of the tool.
        largest_std_mm: Standard deviation of the tool's position that the calibration states there.
        change_mm_per_mm: Change of the shift from one waypoint to the next, for each mm that the tool goes; a
            radian that it turns counts as 300 mm. Where a joint goes farther, counted likewise, that counts.
        change_mrad_per_rad: Change of the turn from one waypoint to the next, likewise for each rad.
        residual_mm: How far from its target the calibrated model may leave the tool; beside the plane that an
            arm cannot leave, `largest_mm` counts.
        residual_mrad: How far turned from it; with fewer than six moving joints, which cannot reach every
            orientation, `largest_deg` counts.
        joint_limits: Whether corrected readings must stay within the robot's limits.
    """

    largest_joint_deg: float | None = LARGEST_JOINT_DEG
    largest_slide_mm: float | None = 10.0
    largest_mm: float | None = LARGEST_MM
    largest_deg: float | None = LARGEST_DEG
    largest_std_mm: float | None = LARGEST_STD_MM
    change_mm_per_mm: float | None = 0.05
    change_mrad_per_rad: float | None = 50.0
    residual_mm: float = 1e-6
    residual_mrad: float = 1e-5
    joint_limits: bool = True

    def __post_init__(self) -> None:
        settle(self, flags=("joint_limits",))
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "joint_limits" or value is None:
                continue
            check_number(value, field.name)
            if not value > 0.0:
                raise UsageError(
                    f"{value}",
                    where=field.name,
                    rule="A bound is positive",
                    way_out="None switches it off, and inf on the command line",
                )

    def core(self, robot: Robot) -> "CorrectorBounds":
        """Internal: the keywords of the core, SI, for an arm."""
        mm, mrad = 1.0 / MM_PER_METRE, 1.0 / MRAD_PER_RAD
        return {
            "joints": np.array(robot.limits) if self.joint_limits else np.empty((0, 2)),
            "largest_angle": _si(self.largest_joint_deg, RADIANS_PER_DEGREE),
            "largest_slide": _si(self.largest_slide_mm, mm),
            "largest_shift": _si(self.largest_mm, mm),
            "largest_turn": _si(self.largest_deg, RADIANS_PER_DEGREE),
            "largest_std": _si(self.largest_std_mm, mm),
            "shift_change": _si(self.change_mm_per_mm, 1.0),
            "turn_change": _si(self.change_mrad_per_rad, mrad),
            "residual": _si(self.residual_mm, mm),
            "residual_turn": _si(self.residual_mrad, mrad),
        }


def _si(value: float | None, factor: float) -> float:
    return math.inf if value is None else value * factor
