"""What an update from proposed poses would leave uncertain: its offsets are found again, the field is not."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from truearm.calibration import Calibration
from truearm.errors import TooFewError
from truearm.measurements import Measurements
from truearm.proposing.candidates import Candidates
from truearm.proposing.next_poses import deviation_mm, workspace_of
from truearm.rotations import quaternion_from_matrix
from truearm.types import Floats
from truearm.updating import UpdateOptions, update

PREDICTED: Final = "as predicted"


def expected_by_update(
    candidates: Candidates,
    workspace: ArrayLike,
    before: Calibration,
    rows: Sequence[Measurements] = (),
    options: UpdateOptions | None = None,
) -> Floats:
    """Expected standard deviation as in NextPoses, now and after an update from all candidates, mm.

    Args:
        candidates: What is measured.
        workspace: Readings (t, N) at which the error counts.
        before: The calibration that is updated.
        rows: Measurements that it is updated from beside.
        options: How it is updated; the defaults without.

    Returns:
        Two numbers; the first alone where the rows are too few for an update.

    Raises:
        UsageError: If the workspace is empty.
        InputError: If it cannot be updated from these for another reason.
        WorkError: If a calibration has no standard deviations.
    """
    where = workspace_of(candidates, workspace)
    now = deviation_mm(where)
    try:
        found = update(before, [*rows, _as_predicted(candidates)], options)
    except TooFewError:
        return np.array([now])
    return np.array([now, deviation_mm(replace(where, calibration=found.calibration))])


def _as_predicted(candidates: Candidates) -> Measurements:
    """What would be measured if all stood where it is predicted: what an update leaves depends on no more."""
    calibration, group, selection = candidates.calibration, candidates.set_up, candidates.selection
    features = candidates.feature_values
    table = pd.DataFrame({f"q{k}": column for k, column in enumerate(candidates.readings.T, start=1)})
    for target in range(max(selection.targets) + 1):
        number = "" if target == 0 else str(target + 1)
        points = np.full((len(table), 3), np.nan)
        if target in selection.targets:
            points = calibration.position(
                candidates.readings, group=group, target=target + 1, features=features
            )
        table[[f"{axis}{number}" for axis in "xyz"]] = points
    if selection.orientation:
        poses = calibration.pose(candidates.readings, group=group, features=features)
        table[["qw", "qx", "qy", "qz"]] = quaternion_from_matrix(poses[:, :3, :3])
    table = table.assign(group=group, **features)
    return Measurements.from_dataframe(table, name=PREDICTED, joints=calibration.robot.joints)
