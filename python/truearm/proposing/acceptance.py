"""The poses that check an old calibration best: those that show most of what is likely to have changed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri, ncfdtrinc

from truearm._core import choose_telling
from truearm.calibration import Calibration
from truearm.planning.spreading import fill, least_distance
from truearm.proposing.candidates import Candidates
from truearm.proposing.next_poses import check_count
from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE
from truearm.updating import UpdateOptions
from truearm.updating.scale import known_scale
from truearm.updating.unknowns import arm_directions, arm_std, setup_std

PAYLOAD_RAD: Final = 3e-4
"""What another payload bends a joint by where its weight has the longest lever."""
APART: Final = 0.5
"""Chosen points are at least this part as far apart as so many that fill the workspace evenly."""
NOTICED: Final = 0.95
"""Share of the cases in which a change is to be noticed."""
TOLD: Final = 0.5
"""A change is told where the rows leave less than this share of its prior's deviation."""
MANY: Final = 100
"""Poses of which more tell of no further change, only of smaller ones."""


@dataclass(frozen=True, eq=False)
class Acceptance:
    """Chosen candidates.

    Attributes:
        rows: Of the candidates (count,), the most telling first.
        information: About all changes together, nat, before the first and after each (count + 1,).
        noticed: The smallest change that is noticed in 95 of 100 cases: of each joint's offset in deg or mm
            ("joint1" ...), and of the target on the tool in mm ("tool"). A joint that cannot be told from the
            frame or the tool is not named.
        alike: Whether nothing is noticed however many poses there are: offsets of the joints, and the target
            in some direction, look like another frame or target.
    """

    rows: NDArray[np.int64]
    information: Floats
    noticed: dict[str, float]
    alike: bool = False


def acceptance_poses(candidates: Candidates, count: int, options: UpdateOptions | None = None) -> Acceptance:
    """Choose `count` candidates that tell most about offsets, frame, tool and payload, and lie apart.

    The criterion is the mutual information of what they show and what may have changed: log det of the
    changes' covariance before over after (D-optimal), where field, noise and set-up scatter as the
    calibration expects.

    Args:
        candidates: What can be measured.
        count: How many.
        options: How far things may have moved, as in update.

    Raises:
        WorkError: As for next_poses.
    """
    check_count(candidates, count)
    chosen = options or UpdateOptions()
    columns, names = _columns(candidates, chosen)
    unchanged = candidates.covariance()
    flat = columns.reshape(len(unchanged), -1)
    evenly = candidates.points[fill(candidates.points, count)]
    apart = APART * least_distance(evenly) if count > 1 else 0.0
    core = candidates.core(apart)
    rows, values = choose_telling(unchanged + flat @ flat.T, unchanged, core, count)
    picked = np.array(rows, dtype=np.int64)

    def noticed(places: NDArray[np.int64]) -> dict[str, float]:
        told = _told_at_last(candidates, unchanged, columns, names, places)
        return _noticed(candidates.calibration, chosen, names, told)

    found = noticed(picked)
    alike = not found and not noticed(fill(candidates.points, MANY))
    return Acceptance(picked, np.array(values), found, alike)


def _columns(candidates: Candidates, options: UpdateOptions) -> tuple[Floats, list[str]]:
    """Derivatives (c, m, k) of what is measured by changes of a prior standard deviation; their names."""
    calibration = candidates.calibration
    arm = calibration.arm
    directions, names = arm_directions(arm)
    offsets = candidates.jacobian @ directions
    torque = arm.robot.joint_jacobian(candidates.readings)[:, 2, :]
    largest = np.abs(torque).max(axis=0)
    turning = np.flatnonzero((largest > 1e-6) & arm.robot.revolute)
    bent = offsets[:, :, turning] * (torque / np.where(largest > 0.0, largest, 1.0))[:, None, turning]
    std = np.array([arm_std(arm, name, options) for name in names])
    setup = candidates.setup * setup_std(arm, candidates.selection, options, known=True)
    whole = np.concatenate([offsets * std, setup, PAYLOAD_RAD * bent], axis=2)
    frame = [] if arm.world_is_known else ["frame"] * 6
    tool = ["tool"] * (setup.shape[2] - len(frame))
    return whole, [*names, *frame, *tool, *(f"payload{k + 1}" for k in turning)]


def _told_at_last(
    candidates: Candidates,
    unchanged: Floats,
    columns: Floats,
    names: Sequence[str],
    rows: NDArray[np.int64],
) -> Floats:
    """As `_told`, by an update that keeps offsets which the rows do not tell as they were."""
    told = _told(candidates, unchanged, columns, rows)
    # What else they tell of is told better then.
    is_joint = np.array([name.startswith("joint") for name in names])
    free = ~is_joint | (told < TOLD)
    told[free] = _told(candidates, unchanged, columns[:, :, free], rows)
    return told


def _told(candidates: Candidates, unchanged: Floats, columns: Floats, rows: NDArray[np.int64]) -> Floats:
    """Standard deviations (k,) of the changes once the rows are measured, in those before."""
    size = columns.shape[1]
    places = (rows[:, None] * size + np.arange(size)).reshape(-1)
    spread = unchanged[np.ix_(places, places)].copy()
    for k, row in enumerate(rows):
        own = slice(k * size, (k + 1) * size)
        spread[own, own] += candidates.noise[row]
    scaled = columns[rows].reshape(len(places), -1)
    precision = scaled.T @ np.linalg.solve(spread, scaled) + np.eye(scaled.shape[1])
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(precision))))


def _noticed(
    calibration: Calibration, options: UpdateOptions, names: Sequence[str], std: Floats
) -> dict[str, float]:
    """Smallest changes by name that would be noticed, as in Acceptance."""
    arm, found = calibration.arm, dict[str, float]()
    known = known_scale(calibration).freedom
    tool = [] if options.new_tool else [k for k, name in enumerate(names) if name == "tool"]
    tested = [*tool, *(k for k, name in enumerate(names) if name.startswith("joint"))]
    # In an update the test of a change shares the level with that of the field.
    errors = standard_errors(int((std[tested] < TOLD).sum()), options.level / 2.0, known)
    for k, name in enumerate(names):
        if name.startswith("joint") and std[k] < TOLD:
            prismatic = arm.robot.joints[int(name.removeprefix("joint")) - 1] == "prismatic"
            unit = MM_PER_METRE if prismatic else 1.0 / RADIANS_PER_DEGREE
            found[name] = float(errors * std[k] * arm_std(arm, name, options) * unit)
    if tool and max(std[tool[:3]]) < TOLD:
        found["tool"] = float(errors * max(std[tool[:3]]) * options.tool_mm)
    return found


def standard_errors(freedom: int, level: float, known: int) -> float:
    """Standard errors of one change that a test of `freedom` changes together notices often enough.

    Such a test says whether a calibration still holds. Its sum of squares, in units of a scale that is known
    from `known` degrees of freedom, is then of the noncentral F distribution.
    """
    if freedom == 0:
        return float("inf")
    if level >= NOTICED:
        return 0.0
    limit = float(fdtri(freedom, known, 1.0 - level))
    return float(np.sqrt(ncfdtrinc(freedom, known, 1.0 - NOTICED, limit)))
