"""What is done in which order: contacts for the frame first, then the poses, with checks in between."""

import hashlib
from typing import Final

import numpy as np

from truearm.cell.cell_file import ProcessSection
from truearm.cell.poses_file import Poses
from truearm.cell.session import Step
from truearm.errors import InputError, count_of

DRAWN: Final = 17


def steps_of(poses: Poses, process: ProcessSection) -> list[Step]:
    """The steps of a session.

    Registration takes different poses at random, always the same for the same list. Every `check_every` poses
    the first of them is measured again, so that a cell that drifts is noticed.

    Raises:
        InputError: If there are fewer different poses than registration needs.
    """
    drawn = _drawn(poses)[: process.registration_poses]
    if len(drawn) < process.registration_poses:
        raise InputError(
            f"the list has {count_of(len(drawn), 'different pose')}",
            rule=f"Registration needs {process.registration_poses}",
            way_out="Give more poses, or lower registration_poses, to 4 at least",
        )
    plan = [("registration", pose) for pose in sorted(drawn)]
    reference = plan[0][1]
    for pose in range(len(poses)):
        if process.check_every and pose and pose % process.check_every == 0:
            plan.append(("check", reference))
        plan.append(("pose", pose))
    if process.check_every:
        plan.append(("check", reference))
    return [
        Step(k, kind, pose, poses.purpose[pose], int(poses.approach[pose]), poses.readings[pose])
        for k, (kind, pose) in enumerate(plan)
    ]


def _drawn(poses: Poses) -> list[int]:
    """All poses in random order, of those with the same readings the one that is drawn first."""
    _, which = np.unique(poses.readings, axis=0, return_inverse=True)
    order = np.random.default_rng(DRAWN).permutation(len(poses))
    _, first = np.unique(which.reshape(-1)[order], return_index=True)
    return [int(pose) for pose in order[np.sort(first)]]


def fingerprint(poses: Poses) -> str:
    """SHA-256 of the list of poses, so that a session is continued with its own list only."""
    digest = hashlib.sha256(np.ascontiguousarray(poses.readings).tobytes())
    digest.update(poses.approach.tobytes())
    digest.update("\n".join(poses.purpose).encode())
    return digest.hexdigest()
