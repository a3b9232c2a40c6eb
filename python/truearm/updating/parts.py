"""Where among parameters and unknowns stands what is compared: offsets, and what of set-ups was measured."""

import numpy as np
from numpy.typing import NDArray

from truearm._core import Setup
from truearm.fits.core_set import Selection
from truearm.fits.identified import IdentifiedArm
from truearm.fits.parameters import KIND_COUNT, THETA, D


def part_of(setup: Setup, used: Selection, fitted: Selection) -> Setup:
    """Set-ups with those of the fitted targets that are used."""
    chosen = [fitted.targets.index(target) for target in used.targets]
    targets = np.ascontiguousarray(setup.targets[:, chosen])
    return Setup(setup.frames, targets, setup.rotations, setup.anchors)


def places_of(arm: IdentifiedArm, used: Selection, fitted: Selection) -> NDArray[np.int64]:
    """Where the unknowns (W,) of a set-up that are used stand among those that were fitted."""
    first = arm.frame_unknowns
    points = [first + 3 * fitted.targets.index(target) + axis for target in used.targets for axis in range(3)]
    behind = first + 3 * len(fitted.targets)
    turn = range(behind, behind + 3 * used.orientation)
    return np.array([*range(first), *points, *turn], dtype=np.int64)


def offset_columns(arm: IdentifiedArm) -> list[int]:
    """The parameter of each moving joint that its reading is added to, among the chain's (5 L)."""
    rows = [row for row, kind in enumerate(arm.joints) if kind != "fixed"]
    return [KIND_COUNT * row + (D if arm.joints[row] == "prismatic" else THETA) for row in rows]
