"""The calibration sampled on a grid of readings, for software that can look up a table."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from truearm.calibration import Calibration
from truearm.errors import UsageError, WorkError
from truearm.exporting.losses import LINK_ORDER, as_comments
from truearm.exporting.parity import OPEN_REACH_M, flange_poses
from truearm.fits.parameters import KINDS
from truearm.robot import Robot
from truearm.rotations import rotation_vector_from_matrix
from truearm.storage.summary import WAVE, describe_blocks, waves_in_words
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si

POINTS: Final = 5
LARGEST: Final = 2_000_000
AXIS: Final = re.compile(r"q(\d+)=([^:,]+)(?::([^:,]+):(\d+))?")
SHIFTS: Final = ("dx_mm", "dy_mm", "dz_mm", "rx_mrad", "ry_mrad", "rz_mrad")
DISPLAYED: Final = {"revolute": "deg", "prismatic": "mm"}
DIGITS: Final = "%.9g"
SHOWN: Final = ".6g"
ROUNDED: Final = 1e-6
"""What readings at a limit are beyond it by rounding, deg or mm."""


@dataclass(frozen=True)
class Axis:
    """Readings of one joint on the grid, in deg or mm: one number, or `count` from `low` to `high`."""

    low: float
    high: float
    count: int

    @property
    def readings(self) -> Floats:
        """The readings, (count,)."""
        return np.linspace(self.low, self.high, self.count)


def grid_axes(calibration: Calibration, stated: str | None = None) -> list[Axis]:
    """An axis for each joint.

    Args:
        calibration: Tells how far the readings went that it was fitted to.
        stated: "q1=-90:90:7,q4=30": from, to and number of readings, or one; deg, and mm of prismatic
            joints. Where it is given, a joint that it does not name stays in the middle of its range; without
            it each joint that moved has five readings over its range.

    Raises:
        UsageError: If it cannot be read, names a joint twice, or leaves a joint's limits.
    """
    ranges = _ranges(calibration)
    if stated is None:
        return [Axis(low, high, 1 if low == high else POINTS) for low, high in ranges]
    axes = [Axis(0.5 * (low + high), 0.5 * (low + high), 1) for low, high in ranges]
    named = set[int]()
    for part in stated.replace(" ", "").split(","):
        number, axis = _axis(part)
        if number in named:
            raise UsageError(
                f'q{number} is named twice: "{stated}"',
                where="--grid",
                rule="A joint has one reading or one range",
                way_out=f"Leave one q{number} out",
            )
        named.add(number)
        if not 1 <= number <= len(axes):
            raise UsageError(f"there is no q{number}", where="--grid", rule=f"The arm has {len(axes)} joints")
        _check_limits(calibration.robot, number, axis)
        axes[number - 1] = axis
    return axes


def _check_limits(robot: Robot, number: int, axis: Axis) -> None:
    unit = DISPLAYED[robot.joints[number - 1]]
    low, high = (float(limit) / to_si(1.0, unit) for limit in robot.limits[number - 1])
    if not low - ROUNDED <= min(axis.low, axis.high) <= max(axis.low, axis.high) <= high + ROUNDED:
        raise UsageError(
            f"q{number} from {axis.low:{SHOWN}} to {axis.high:{SHOWN}} {unit}",
            where="--grid",
            rule=f"Its limits are {low:{SHOWN}} to {high:{SHOWN}} {unit}",
        )


def grid_table(
    calibration: Calibration,
    axes: Sequence[Axis],
    *,
    features: Mapping[str, ArrayLike] | None = None,
    with_std: bool = False,
) -> pd.DataFrame:
    """A row for each point of the grid, the last joint running fastest.

    Columns: the readings; `dx_mm` to `rz_mrad`, from the nominal flange to the calibrated one in the base
    frame, translation and rotation vector; `std_mm`, the standard deviation of the calibrated flange's place,
    root of the sum of the variances of x, y, z; and for each link what is added to its nominal parameters,
    `theta1_deg`, `d1_mm` and so on.

    Raises:
        WorkError: If the calibration has no field: it is constant, or of one of the paper's schemes.
        UsageError: If features are missing, or the grid has more than two million points.
    """
    if calibration.scheme is not None:
        raise WorkError(
            f"this calibration is of the scheme {calibration.model_name}",
            rule="Samples are those of a field, which a variable model has",
            way_out="Calibrate with --model variable; --to urdf and --to dh-toml hold the constant part",
        )
    if calibration.variable is None:
        raise WorkError(
            "this calibration has no field: its parameters are constant",
            way_out="Export them with --to urdf or --to dh-toml",
        )
    count = math.prod(axis.count for axis in axes)
    if count > LARGEST:
        raise UsageError(f"the grid has {count} points", where="--grid", rule=f"At most {LARGEST}")
    robot = calibration.robot
    shown = np.stack(np.meshgrid(*(axis.readings for axis in axes), indexing="ij"), axis=-1).reshape(
        count, -1
    )
    units = [DISPLAYED[kind] for kind in robot.joints]
    q = np.column_stack([to_si(shown[:, j], unit) for j, unit in enumerate(units)])
    table = {f"q{j + 1}_{unit}": shown[:, j] for j, unit in enumerate(units)}
    calibrated = calibration.pose(q, tool=np.eye(4), features=features)
    table |= dict(zip(SHIFTS, _shifts(flange_poses(robot, q), calibrated).T, strict=True))
    if with_std:
        std = calibration.position_std(q, tool=np.eye(4), features=features)
        table["std_mm"] = np.linalg.norm(std, axis=1) * MM_PER_METRE
    added = calibration.parameters(q, features=features) - robot.table
    return pd.DataFrame(table | _corrections(added))


def grid_text(
    table: pd.DataFrame,
    calibration: Calibration,
    axes: Sequence[Axis],
    features: Mapping[str, float] | None = None,
    *,
    notes: Sequence[str] = (),
) -> str:
    """The table as CSV with comments on what it is, where it was sampled, and what each column is.

    `notes` are what else is to be minded of these samples.
    """
    stated = [f"{name} {value:{SHOWN}}" for name, value in (features or {}).items()]
    comments = [
        f"{calibration.robot.name}, calibrated by truearm {calibration.version}: samples of what varies",
        f"Sampled at {'; '.join(_in_words(calibration, axes))}, the last one running fastest",
        *([f"Features: {', '.join(stated)}"] if stated else []),
        *notes,
        *_columns_in_words(list(table.columns), calibration),
        *_base_in_words(calibration),
        "Between samples the field is not linear; beyond the readings it was learnt at it is a guess",
        *_waves_in_words(calibration),
    ]
    return as_comments(comments) + table.to_csv(index=False, float_format=DIGITS, lineterminator="\n")


def _waves_in_words(calibration: Calibration) -> list[str]:
    """Of each joint with waves that the samples hold, and that no table between them can follow."""
    waves: dict[int, list[dict[str, Any]]] = {}
    for block in describe_blocks(calibration):
        if block["name"] == WAVE:
            waves.setdefault(block["joints"][0], []).append(block)
    return [
        f"Samples hold waves of joint {joint} with {waves_in_words(found, SHOWN)}, lost between them"
        for joint, found in sorted(waves.items())
    ]


def _in_words(calibration: Calibration, axes: Sequence[Axis]) -> list[str]:
    """The readings of each joint: "q2 -90 to 0 deg in 4 steps"."""
    units = [DISPLAYED[kind] for kind in calibration.robot.joints]
    return [
        f"q{number} = {axis.low:{SHOWN}} {unit}"
        if axis.count == 1
        else f"q{number} from {axis.low:{SHOWN}} to {axis.high:{SHOWN}} {unit}, {axis.count} readings"
        for number, (axis, unit) in enumerate(zip(axes, units, strict=True), start=1)
    ]


def _columns_in_words(columns: Sequence[str], calibration: Calibration) -> list[str]:
    """What each kind of column is; the unit of each stands in its name."""
    count = calibration.robot.joint_count
    said = [
        f"q1 to q{count}: joint readings, as the controller shows them",
        "dx_mm, dy_mm, dz_mm: from the nominal flange to the calibrated one, along the axes of the base",
        "rx_mrad, ry_mrad, rz_mrad: rotation vector from the nominal flange to the calibrated one, along the "
        "axes of the base",
    ]
    if "std_mm" in columns:
        said.append(
            "std_mm: standard deviation of the flange's place, root of the sum of the variances of x, y, z"
        )
    first = next((name for name in columns[count + len(SHIFTS) :] if name != "std_mm"), None)
    if first is not None:
        order = LINK_ORDER[calibration.robot.convention]
        said.append(
            f"{first} and so on: what is added to that parameter of the nominal D-H table there, "
            "the constant part and what varies together; the number is the link's, and a link is "
            f"{order}. A parameter without a column is the nominal one everywhere"
        )
    return said


def _base_in_words(calibration: Calibration) -> list[str]:
    """Where the base was found, which no column holds: a field leaves it alone."""
    if not calibration.arm.world_is_known:
        return []
    found = calibration.arm.bases(calibration.model.constants[None])
    shift = _shifts(calibration.robot.base[None], found)[0]
    moved, turned = (", ".join(f"{value:{SHOWN}}" for value in part) for part in (shift[:3], shift[3:]))
    return [
        f"Before link 1 the base is {moved} mm from the nominal one along x, y and z of world, turned by the "
        f"rotation vector {turned} mrad"
    ]


def _axis(text: str) -> tuple[int, Axis]:
    found = AXIS.fullmatch(text)
    try:
        if found is None:
            raise ValueError(text)
        number, low = int(found[1]), float(found[2])
        axis = Axis(low, low, 1) if found[3] is None else Axis(low, float(found[3]), int(found[4]))
        if axis.count < (1 if axis.low == axis.high else 2) or not np.isfinite([axis.low, axis.high]).all():
            raise ValueError(text)
    except ValueError:
        raise UsageError(
            f'"{text}" is no axis of a grid',
            where="--grid",
            rule="qJ=FROM:TO:COUNT, two readings at least, or qJ=VALUE; deg or mm",
        ) from None
    return number, axis


def _ranges(calibration: Calibration) -> list[tuple[float, float]]:
    """Lowest and highest reading of each joint, deg or mm: of the rows, else of the limits."""
    robot = calibration.robot
    if calibration.learned_from is not None:
        q = calibration.learned_from.data.readings
        low, high = q.min(axis=0), q.max(axis=0)
    else:
        low, high = robot.finite_limits(OPEN_REACH_M)
    scale = np.array([1.0 / to_si(1.0, DISPLAYED[kind]) for kind in robot.joints])
    return list(zip((low * scale).tolist(), (high * scale).tolist(), strict=True))


def _shifts(nominal: Floats, calibrated: Floats) -> Floats:
    """Translation in mm and rotation vector in mrad (n, 6), base frame."""
    turns = rotation_vector_from_matrix(calibrated[:, :3, :3] @ nominal[:, :3, :3].transpose(0, 2, 1))
    return np.asarray(np.hstack([calibrated[:, :3, 3] - nominal[:, :3, 3], turns]) * MM_PER_METRE)


def _corrections(added: Floats) -> dict[str, Floats]:
    """Columns of corrections (n, N, 5), but for those that are zero everywhere."""
    units = ("deg", "mm", "mm", "deg", "deg")
    columns = {
        f"{kind}{link + 1}_{unit}": added[:, link, k] / to_si(1.0, unit)
        for link in range(added.shape[1])
        for k, (kind, unit) in enumerate(zip(KINDS, units, strict=True))
    }
    return {name: values for name, values in columns.items() if values.any()}
