"""All inverse kinematics of a plain arm: the readings at which its flange has a given pose."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from truearm._core import CoreError
from truearm._core import Inverse as Solver
from truearm.arrays import as_rows, as_transforms
from truearm.errors import InputError, WorkError, count_of, list_rows
from truearm.robot import Robot
from truearm.types import Floats, Mask

SIDES: Final = (("rear", "front"), ("down", "up"), ("noflip", "flip"))


class Inverse:
    """Solves for the readings of a plain arm, such as a nominal or a factory-calibrated one.

    Arms with an ortho-parallel base and a spherical wrist, and those with three parallel axes as Universal
    Robots has them, are solved in closed form on the plain arm nearest to the given one, and polished on the
    given one: all their up to eight solutions are found. A calibrated wrist whose axes do not quite meet has
    more of them where it is nearly straight, of which a few may be lacking: they are searched for from eight
    sides. `near` finds the one that a seed is near to. Other arms are solved by Newton steps from many
    starts, which finds all solutions as a rule but cannot promise it. An arm with more than six axes has
    infinitely many solutions: `solutions` gives a sample, `near` the one that the seed leads to. An arm with
    fewer than six takes the nearest orientation, within 2 mrad, so that the rounded numbers of a program,
    which are never quite within its reach, are solved too.

    Poses are of the flange in the robot's base frame; a tool is taken off with base_from_tool @ inv(tool).

    Attributes:
        robot: The arm.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        coupling = np.ascontiguousarray(robot.coupling)
        back = np.ascontiguousarray(np.linalg.inv(coupling))
        self._solver = Solver(robot.flange_chain, coupling, back, np.ascontiguousarray(robot.limits))

    def __repr__(self) -> str:
        return f"<Inverse of {self.robot.name}: {self.method}>"

    def __reduce__(self) -> tuple[object, ...]:
        return Inverse, (self.robot,)

    @property
    def method(self) -> str:
        """How it is solved: "spherical wrist" or "three parallel axes", closed forms, or "numeric"."""
        return self._solver.method

    def solutions(self, base_from_flange: ArrayLike, *, turns: bool = False) -> Floats:
        """Readings (k, N) within limits at which the flange has the pose (4, 4); k is 0 where none reaches.

        Args:
            base_from_flange: The pose.
            turns: Give all readings that differ by whole turns, not only those nearest to the middle of the
                limits; of a joint without limits those within one turn of zero.

        Raises:
            InputError: If the pose is not a rigid transform, or they are several.
            WorkError: If a pose of the arm's has more than 100,000 readings that differ by whole turns.
        """
        poses, single = as_transforms(base_from_flange, what="the poses")
        if not single:
            raise InputError(
                f"the pose has shape {poses.shape}",
                rule="The shape must be (4, 4)",
                way_out="branches() and near() take many poses",
            )
        try:
            return self._solver.solutions(poses[0], turns)
        except CoreError as error:
            raise WorkError(str(error), way_out="Give narrower joint limits, or turns=False") from None

    def branches(self, base_from_flange: ArrayLike) -> Floats:
        """The solutions of many poses (n, 4, 4) without turns: (n, K, N), filled up with NaN to the most, K.

        Raises:
            InputError: If a pose is not a rigid transform.
        """
        poses, _ = as_transforms(base_from_flange, what="poses")
        rows, counts = self._solver.all(poses)
        width = max(counts, default=0)
        found = np.full((len(poses), width, self.robot.joint_count), np.nan)
        found[np.arange(width) < np.array(counts, dtype=np.intp)[:, None]] = rows
        return found

    def near(self, base_from_flange: ArrayLike, seed: ArrayLike) -> Floats:
        """The solutions within limits near the seed, turns included: (n, N), or (N,) for one pose.

        The nearest where the arm's solutions are known in closed form, exactly or nearly; of other arms the
        one that a search from the seed arrives at.

        Args:
            base_from_flange: Poses (n, 4, 4) or (4, 4).
            seed: Readings (N,), or (n, N) with one for each pose.

        Raises:
            InputError: If a pose is not a rigid transform, or the seeds are not as many as the poses.
            WorkError: If no readings within limits reach a pose; names the poses, counted from 1.
        """
        found, single = self._near(base_from_flange, seed)
        missing = np.flatnonzero(np.isnan(found).any(axis=1)) + 1
        if len(missing):
            raise WorkError(
                f"{self.robot.name} does not reach {list_rows(missing.tolist(), 'pose')} within its limits",
                way_out="Move the poses into its reach, or widen the limits of the robot file",
            )
        return found[0] if single else found

    def near_or_nan(self, base_from_flange: ArrayLike, seed: ArrayLike) -> Floats:
        """As :meth:`near`, with NaN where no readings within limits reach a pose.

        Raises:
            InputError: If a pose is not a rigid transform, or the seeds are not as many as the poses.
        """
        found, single = self._near(base_from_flange, seed)
        return found[0] if single else found

    def branch_names(self, q: ArrayLike) -> list[str]:
        """The branch of each of the readings (n, N) in words, such as "front up noflip".

        "front" or "rear": whether the wrist is on the side of the first axis that the arm faces; "up" or
        "down": whether the elbow is above the line from the second axis to the wrist; "flip" where the fifth
        joint is bent the negative way from where the fourth and sixth axis are in line, else "noflip". Arms
        with five axes have no third word, and arms without a first axis across two parallel ones no name:
        "". Names tell the branches of one arm apart; makers name theirs by rules of their own.
        """
        rows, _ = as_rows(q, self.robot.joint_count, what=f"joint readings of {self.robot.name}")
        return [_name(sides) for sides in self._solver.branches(rows)]

    def sides(self, q: ArrayLike) -> Mask:
        """Internal: on which side of each singularity the arm stands at readings (n, N), (n, S).

        Of an arm whose branches have names these are the shoulder's, the elbow's and the wrist's, of which
        the elbow's does not depend on the shoulder's as its name does; of any other one that of its
        Jacobian's determinant, which each singularity changes.
        """
        rows, _ = as_rows(q, self.robot.joint_count, what=f"joint readings of {self.robot.name}")
        branches = self._solver.branches(rows)
        if any(sides is None for sides in branches):
            positive: Mask = np.linalg.det(self.robot.joint_jacobian(rows, pose=True))[:, None] > 0.0
            return positive
        named = np.array(branches, dtype=bool).reshape(-1, len(SIDES))
        named[:, 1] ^= named[:, 0]
        return named

    def _near(self, base_from_flange: ArrayLike, seed: ArrayLike) -> tuple[Floats, bool]:
        poses, single = as_transforms(base_from_flange, what="poses")
        seeds, one = as_rows(seed, self.robot.joint_count, what="seeds")
        if one:
            seeds = np.repeat(seeds, len(poses), axis=0)
        if len(seeds) != len(poses):
            raise InputError(
                f"there are {count_of(len(seeds), 'seed')} for {count_of(len(poses), 'pose')}",
                rule="One seed for all poses, or one for each",
            )
        return self._solver.near(poses, np.ascontiguousarray(seeds)), single


def _name(sides: Sequence[bool | None] | None) -> str:
    if sides is None:
        return ""
    return " ".join(words[side] for words, side in zip(SIDES, sides, strict=True) if side is not None)
