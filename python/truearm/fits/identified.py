"""The arm as it is identified: its links, and in front of them its base where that is to be corrected too."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from truearm._core import Chain
from truearm.fits.parameters import PARALLEL_WITHIN_DEG, Candidates, candidates
from truearm.kinds import required
from truearm.robot import Robot
from truearm.types import Floats

Frame = Literal["free", "world"]

FRAME_UNKNOWNS: Final = 6


@dataclass(frozen=True, eq=False)
class IdentifiedArm:
    """A robot and what of it is an unknown.

    With `frame` "free" the robot's base is fixed and each set-up has a world_from_base of its own. With
    "world" there is none: the base is a Denavit-Hartenberg row of its own, row 0, before the links.

    Attributes:
        robot: The nominal arm.
        frame: "free" or "world".
        parallel_within_deg: Angle between axes up to which they count as parallel.
    """

    robot: Robot
    frame: Frame = "free"
    parallel_within_deg: float = PARALLEL_WITHIN_DEG

    def __post_init__(self) -> None:
        required(self.robot, Robot, "the robot")

    def __reduce__(self) -> tuple[object, ...]:
        return IdentifiedArm, (self.robot, self.frame, self.parallel_within_deg)

    @property
    def world_is_known(self) -> bool:
        """Whether there is no world_from_base."""
        return self.frame == "world"

    @property
    def frame_unknowns(self) -> int:
        """Unknowns of the world_from_base of a set-up."""
        return 0 if self.world_is_known else FRAME_UNKNOWNS

    @property
    def joints(self) -> list[str]:
        """Kind of each of the L rows."""
        return ["fixed", *self.robot.joints] if self.world_is_known else list(self.robot.joints)

    @cached_property
    def table(self) -> Floats:
        """Nominal parameters (L, 5)."""
        if not self.world_is_known:
            return self.robot.table
        row = np.zeros(5) if self.robot.base_row is None else self.robot.base_row
        return np.vstack([row, self.robot.table])

    @property
    def links(self) -> slice:
        """The rows that are links: all, or all but the base."""
        return slice(1 if self.world_is_known else 0, None)

    @cached_property
    def flange_chain(self) -> Chain:
        """The compiled chain from base to flange."""
        return self.chain(self.robot.flange)

    def chain(self, end: Floats) -> Chain:
        """The compiled chain that ends with the transform `end` (4, 4) after the last link."""
        return self._chain(self.joints, np.ascontiguousarray(end))

    def bases(self, parameters: Floats) -> Floats:
        """Transforms (n, 4, 4) before the first link, of parameters (n, L, 5)."""
        if not self.world_is_known:
            return np.tile(self.robot.base, (len(parameters), 1, 1))
        row = np.ascontiguousarray(parameters[:, :1])
        # A chain needs a joint: the base is one that stands at zero.
        return self._chain(["revolute"], np.eye(4)).pose(np.zeros((len(row), 1)), row)

    def _chain(self, joints: list[str], end: Floats) -> Chain:
        """The compiled chain of the first rows, as many as joints."""
        base_is_row = self.world_is_known and self.robot.base_row is not None
        base = np.eye(4) if base_is_row else self.robot.base
        return Chain(self.robot.convention, joints, self.table[: len(joints)], base, end)

    @cached_property
    def candidates(self) -> Candidates:
        """The parameters that are asked for."""
        return candidates(self.robot.convention, self.joints, self.table, self.parallel_within_deg)
