"""Two calibrations of one arm as they can be compared: where nothing tells, one stands as the other does."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.fits.parameters import KIND_COUNT
from truearm.types import Floats

TAKEN_OVER: Final = 0.01
"""Base and tool take over what a parameter does to the points where they leave less than this of it."""


def as_placed_in(
    now: Calibration,
    previous: Calibration,
    readings: Floats,
    tool: Floats,
    features: Mapping[str, Floats] | None,
) -> Calibration:
    """`previous` with the base and flange of `now`, as far as not both calibrations determined them.

    What one device cannot tell from its own place or from that of the target, another, or one that stood
    still, may have told: a turn of the base about the axis of joint 1, of the flange about that of the last.
    These parameters are taken from `now`; positions that follow from the others stay what they are.

    Args:
        now: The calibration whose base and flange it is.
        previous: Of the same arm.
        readings: Poses (n, N) over which they are compared.
        tool: Transform (4, 4) from the flange of `previous` to the point that is compared.
        features: A number for each pose (n,) by the name of each feature of `previous`.
    """
    first = KIND_COUNT * (previous.arm.links.start or 0)
    columns = np.array(_not_in_both(previous, now, first), dtype=np.int64)
    shown = previous.parameter_jacobian(readings, tool=tool, features=features)
    shown = shown[:, :, columns - first].reshape(-1, len(columns))
    motions = _motions(previous, previous.pose(readings, tool=tool, features=features))
    left = shown - motions @ np.linalg.lstsq(motions, shown, rcond=None)[0]
    of_place = np.linalg.norm(left, axis=0) <= TAKEN_OVER * np.linalg.norm(shown, axis=0)
    model, taken = previous.model, columns[of_place]
    constants = model.constants.copy()
    constants.flat[taken] = now.model.constants.flat[taken]
    placed = replace(model, constants=constants)
    return replace(previous, models={**previous.models, previous.model_name: placed}, fitted_spread=None)


def _not_in_both(previous: Calibration, now: Calibration, first: int) -> list[int]:
    """Parameters of links, from column `first` on, that only one of the calibrations determined, or none."""
    if previous.robot.convention != now.robot.convention:
        return []
    in_both = set(previous.constant.names) & set(now.constant.names)
    named = zip(previous.arm.candidates.columns, previous.arm.candidates.names, strict=True)
    return [column for column, name in named if column >= first and name not in in_both]


def _motions(calibration: Calibration, poses: Floats) -> Floats:
    """How points (3 n, m) follow motions of the base, unless the world is known, and of the tool."""
    points, turns = poses[:, :3, 3], poses[:, :3, :3]
    axes = np.eye(3)
    about = np.cross(axes[None], points[:, None]).swapaxes(1, 2)
    of_base: list[Floats] = (
        [] if calibration.arm.world_is_known else [np.broadcast_to(axes, turns.shape), about]
    )
    return np.asarray(np.concatenate([*of_base, turns], axis=2).reshape(3 * len(poses), -1))
