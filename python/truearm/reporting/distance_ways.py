"""From which sides of the workspace distances were measured."""

from typing import Final

import numpy as np

from truearm.fits.core_set import anchor_names
from truearm.reporting.facts import Facts

POSES: Final = 300
WELL_APART: Final = 0.25
"""Of directions along their least common one, root mean square: those within some 20 deg of one another
have less.
"""


def has_all_ways(facts: Facts) -> bool:
    """Whether distances go to fixed points in three directions, so that further points tell little more.

    Directions are those from the middle of the flange's places, in the base frame.
    """
    rows, setup, robot = facts.calibration.rows, facts.calibration.model.setup, facts.calibration.robot
    if rows is None or (anchors := rows.data.anchor) is None:
        return False
    middle = robot.flange_chain.pose(robot.joints_from_readings(facts.drawn(POSES)))[:, :3, 3].mean(axis=0)
    groups, names = facts.calibration.groups, anchor_names(rows.data)
    ways = []
    for group, anchor in sorted(set(zip(rows.data.group.tolist(), anchors.tolist(), strict=True))):
        if anchor:
            frame = setup.frames[groups.index(group)]
            away = frame[:3, :3].T @ (setup.anchors[names.index(anchor)] - frame[:3, 3]) - middle
            ways.append(away / np.linalg.norm(away))
    if len(ways) < 3:
        return False
    return bool(np.linalg.svd(np.array(ways), compute_uv=False)[-1] >= WELL_APART * np.sqrt(len(ways)))
