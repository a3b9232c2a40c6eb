"""The poses that reduce the expected error over the workspace most, given what is known already."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truearm._core import choose_informative
from truearm.arrays import as_rows
from truearm.errors import UsageError, WorkError
from truearm.kinds import required
from truearm.proposing.candidates import Candidates
from truearm.types import AXES, Floats
from truearm.units import MM_PER_METRE


@dataclass(frozen=True, eq=False)
class NextPoses:
    """Chosen candidates.

    Attributes:
        rows: Of the candidates (count,), the one that teaches most first.
        expected_mm: Expected standard deviation of the first target's position over the workspace, in the
            set-up's world and without noise: root of the mean of the sum over x, y and z, before the first
            and after each (count + 1,).
    """

    rows: NDArray[np.int64]
    expected_mm: Floats

    @property
    def teach(self) -> bool:
        """Whether less is expected once they are measured than before, as far as that can be told."""
        return len(self.expected_mm) == 1 or bool(self.expected_mm[-1] < self.expected_mm[0])


def next_poses(candidates: Candidates, workspace: ArrayLike, count: int) -> NextPoses:
    """Choose `count` candidates one after the other, each that which leaves the workspace the least variance.

    The variance is the exact Gaussian posterior's, of constants, field and set-up together, after the
    candidates before were measured (A-optimal over the workspace; active learning of Cohn 1996). It needs no
    measured values, only poses. The hyper-parameters stay as they are.

    Args:
        candidates: What can be measured.
        workspace: Readings (t, N) at which the error counts.
        count: How many.

    Raises:
        UsageError: If the workspace is empty.
        WorkError: If there are too few candidates, or the calibration has no standard deviations: it is
            stripped, or of a scheme.
    """
    check_count(candidates, count)
    where = workspace_of(candidates, workspace)
    rows, variance = choose_informative(candidates.covariance(where), candidates.core(), count)
    expected = MM_PER_METRE * np.sqrt(np.array(variance) / len(where))
    return NextPoses(np.array(rows, dtype=np.int64), expected)


def workspace_of(candidates: Candidates, readings: ArrayLike) -> Candidates:
    """The readings (t, N) at which the error counts, in the set-up of the candidates.

    Raises:
        UsageError: If there are none.
    """
    robot = candidates.calibration.robot
    rows, _ = as_rows(readings, robot.joint_count, what=f"joint readings of {robot.name}")
    where = replace(candidates, readings=rows, group=candidates.set_up)
    if len(where) == 0:
        raise UsageError("the workspace has no poses", rule="The error is told at one or more")
    return where


def deviation_mm(workspace: Candidates) -> float:
    """Expected standard deviation as in NextPoses at the readings of a workspace, before any of them."""
    rows, own, inputs = workspace.parts(AXES)
    variances = np.einsum("nii->n", workspace.calibration.spread.each(inputs, rows, own))
    return float(MM_PER_METRE * np.sqrt(variances.mean()))


def check_count(candidates: Candidates, count: int) -> None:
    """Raise WorkError unless there are `count` candidates, UsageError unless they are some."""
    required(candidates, Candidates, "the candidates")
    if not 0 < count <= len(candidates):
        raise WorkError(
            f"{count} poses are to be chosen from {len(candidates)}",
            rule="At least one, and no more than there are",
            way_out="Draw more candidates, or ask for another number",
        )
