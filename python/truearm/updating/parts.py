"""What of a calibration's set-ups other measurements show: fewer targets, or no orientation."""

import numpy as np
from numpy.typing import NDArray

from truearm._core import Setup
from truearm.fits.core_set import Selection
from truearm.fits.identified import IdentifiedArm


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
