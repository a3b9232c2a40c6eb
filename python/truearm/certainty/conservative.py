"""Standard deviations for controllers: quick to evaluate, and never smaller than the exact ones.

The exact standard deviation of a calibration needs the measurements and takes a millisecond. For compensation
and for controllers a calibration file carries bounds of it as tables over the configuration: one number for
the position of a point of the flange's frame, the root of the sum of its coordinates' variances (m), and one
for the rotation vector (rad). The point, the centre, is the middle of what was measured. The first is a
multiple of how far uncertain constants, base and tool move that point: a factor of their covariance, and
tables for what it does not follow.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Chain, Conservative
from truearm.description.robot_data import OPEN_REACH_M
from truearm.fits.fitting import feature_values
from truearm.types import Floats

if TYPE_CHECKING:
    from truearm._core import BoundsPlan
    from truearm.calibration import Calibration
    from truearm.robot import Robot


SAMPLES: Final = 4000
FEWEST_SAMPLES: Final = 2000
QUICK_ROWS: Final = 1200
"""Measured values up to which an exact standard deviation takes less than a millisecond."""
ENDS: Final = 0.1
"""Configurations are drawn so far beyond a range, as a share of it, and then brought back to its ends."""
BEYOND: Final = 0.5
"""Features are bounded so far beyond what was measured, as a share of its range: another day is warmer."""
SEED: Final = 0
BATCH: Final = 128
"""Configurations, or up to twice as many, between which an interrupt is heard: of thousands of poses half a
second."""
TOGETHER: Final = 3
"""So many joints, those that place the wrist, are tabulated together as well."""
PRIOR_MARGIN: Final = 1.1
"""Over the largest prior seen: it is sampled as well."""
FLANGE: Final = (0.0, 0.0, 0.0)
"""The centre where a file does not say."""
SMALLEST: Final = 1e-12
"""What was not asked for has no uncertainty; its logarithm is still taken."""


@dataclass(frozen=True, eq=False)
class Reach:
    """Where configurations are drawn from.

    Attributes:
        limits: Lowest and highest reading (N, 2), and features (F, 2) behind them.
        box: The same of the measurements; the limits where there are none.
        rows: Readings and features of the measurements (n, N + F), clipped to the limits; None where there
            are none.
    """

    limits: Floats
    box: Floats
    rows: Floats | None

    @classmethod
    def of(cls, calibration: "Calibration") -> "Reach":
        """That of a calibration's arm and measurements."""
        measured = _measured(calibration)
        limits = _closed_limits(calibration.robot, measured)
        if measured is None:
            return cls(limits, limits, None)
        joints = len(limits)
        features = np.column_stack([measured.min(axis=0), measured.max(axis=0)])[joints:]
        around = features + BEYOND * np.diff(features) * [-1.0, 1.0]
        limits = np.vstack([limits, around])
        rows = np.clip(measured, *limits.T)
        return cls(limits, np.column_stack([rows.min(axis=0), rows.max(axis=0)]), rows)

    def draw(self, count: int, rng: np.random.Generator) -> Floats:
        """Readings and features (count, N + F): within the limits, in the box of the measurements, and on the
        way from one measurement to another, as many of each.

        Of the first two a joint in six lies on an end of its range: there the tables know least.
        """
        place = np.clip(rng.uniform(-ENDS, 1.0 + ENDS, (count, len(self.limits))), 0.0, 1.0)
        kind = np.arange(count) % 3
        box = np.where(kind[:, None, None] == 0, self.limits, self.box)
        drawn = np.asarray(box[..., 0] + (box[..., 1] - box[..., 0]) * place)
        if self.rows is not None:
            ends = self.rows[rng.integers(len(self.rows), size=(2, count))]
            way = ends[0] + (ends[1] - ends[0]) * rng.uniform(size=(count, 1))
            drawn[kind == 2] = way[kind == 2]
        return drawn


def conservative_of(calibration: "Calibration") -> Conservative:
    """Bounds of a calibration's standard deviation, fitted to exact ones and tested on fresh ones.

    Raises:
        WorkError: If the exact ones need rows that were left out of the file.
    """
    reach, rng = Reach.of(calibration), np.random.default_rng(SEED)
    count = _sample_count(calibration)
    centre: Floats = calibration.measured.points(calibration.model.setup.targets).mean(axis=0)
    (fitted, prior), (fresh, _) = (_exact(calibration, centre, reach.draw(count, rng)) for _ in range(2))
    largest = np.maximum(PRIOR_MARGIN * prior.max(axis=0), np.maximum(fitted[1], fresh[1]).max(axis=0))
    robot = calibration.robot
    plan: BoundsPlan = {
        "angles": robot.revolute.tolist() + [False] * len(calibration.options.features),
        "ranges": _input_ranges(robot, reach.limits),
        "together": list(range(min(TOGETHER, robot.joint_count))),
        "largest": largest.tolist(),
        "centre": centre.tolist(),
    }
    return Conservative.fit(plan, fitted, fresh, robot.flange_chain)


def pack(conservative: Conservative, arrays: dict[str, NDArray[Any]]) -> dict[str, Any]:
    """JSON values of bounds; their arrays are added to `arrays`."""
    blocks = []
    for number, block in enumerate(conservative.blocks()):
        arrays[f"conservative.block{number}.weights"] = block.pop("weights")
        blocks.append({**block, "axes": [list(axis) for axis in block["axes"]]})
    factor = conservative.factor()
    if factor is not None:
        arrays["conservative.leverage"] = factor
    return {**conservative.content(), "blocks": blocks, "leverage": factor is not None}


def unpack(content: dict[str, Any], arrays: dict[str, NDArray[Any]], chain: Chain) -> Conservative:
    """The bounds that `pack` described, of an arm with a chain to the flange.

    Raises:
        KeyError: If an array is missing.
    """
    blocks = [
        {
            **block,
            "axes": [tuple(axis) for axis in block["axes"]],
            "weights": arrays[f"conservative.block{number}.weights"],
        }
        for number, block in enumerate(content["blocks"])
    ]
    leverage = (chain, arrays["conservative.leverage"]) if content.get("leverage") else None
    return Conservative({"centre": FLANGE, **content}, blocks, leverage)


def _exact(calibration: "Calibration", centre: Floats, drawn: Floats) -> tuple[tuple[Floats, Floats], Floats]:
    """Inputs with exact values (n, 2), and the prior's (n, 2), of readings and features (n, N + F)."""
    joints = calibration.robot.joint_count
    names = calibration.options.features
    parts = []
    for rows in np.array_split(drawn, max(len(drawn) // BATCH, 1)):
        features = dict(zip(names, rows[:, joints:].T, strict=True))
        parts.append(calibration.pose_variances(rows[:, :joints], centre, features))
    inputs, exact, prior = (np.concatenate(part) for part in zip(*parts, strict=True))
    return (inputs, _roots(exact)), _roots(prior)


def _roots(variances: Floats) -> Floats:
    """Roots (n, 2) of the sums of position's and rotation's variances (n, 6)."""
    return np.asarray(np.sqrt(np.maximum(variances.reshape(-1, 2, 3).sum(axis=2), SMALLEST**2)))


def _sample_count(calibration: "Calibration") -> int:
    learned = calibration.learned_from
    rows = 0 if learned is None else learned.residual.size
    if calibration.variable is None or rows <= QUICK_ROWS:
        return SAMPLES
    return max(FEWEST_SAMPLES, SAMPLES * QUICK_ROWS // rows)


def _measured(calibration: "Calibration") -> Floats | None:
    """Readings and features of the measurements, (n, N + F)."""
    if calibration.learned_from is None:
        return None
    data = calibration.learned_from.data
    return np.hstack([data.readings, feature_values(data, calibration.options.features)])


def _closed_limits(robot: "Robot", measured: Floats | None) -> Floats:
    """Limits (N, 2), with a turn or the measured reach where the robot states none."""
    limits = robot.limits.copy()
    for joint, kind in enumerate(robot.joints):
        if not np.isfinite(limits[joint]).all():
            reach = np.pi if kind == "revolute" else OPEN_REACH_M
            column = np.zeros(1) if measured is None or kind == "revolute" else measured[:, joint]
            low, high = limits[joint]
            limits[joint, 0] = low if np.isfinite(low) else min(column.min(), high) - reach
            limits[joint, 1] = high if np.isfinite(high) else max(column.max(), low) + reach
    return limits


def _input_ranges(robot: "Robot", limits: Floats) -> list[tuple[float, float]]:
    """Lowest and highest joint value that readings within the limits give, then those of the features."""
    joints = robot.joint_count
    low, high = limits[:joints].T
    ends = np.stack([robot.coupling * low, robot.coupling * high])
    ranges = np.column_stack([ends.min(axis=0).sum(axis=1), ends.max(axis=0).sum(axis=1)])
    return [(float(a), float(b)) for a, b in np.vstack([ranges, limits[joints:]])]
