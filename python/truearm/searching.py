"""Readings for poses near seeds and on their branch: the core's search, and a second one where it fails."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from truearm._core import Solver
from truearm.branches import NUMERIC, beside, crossed, starts, strayed
from truearm.inverse import Inverse
from truearm.limits import Task
from truearm.robot import Robot
from truearm.types import Floats

BRANCH: Final = (11, "the solution lies on another branch of the arm than its seed")
"""Code and reason of a refusal, as the core has them."""
POSE_JOINTS: Final = 6
"""Joints that a pose needs: with as many there are branches."""

Refused = dict[int, tuple[int, str]]
"""By place: why there is no solution, for programs and for people."""


class Search:
    """Finds readings of one arm for poses of one tool.

    The core's search walks from the seed to the target. It may be held up at a singularity or a limit on the
    way though the seed's branch leads round it, and where the seed stands in a singularity, or where the
    calibrated arm is on the other side of one than the nominal arm, it judges by a side that means nothing.
    What it refuses is looked for once more, from the nominal arm's solution on the seed's branch; and, as the
    nominal arm may not reach what the calibrated one does, from both sides of a singularity of the seed.
    """

    def __init__(
        self, robot: Robot, solver: Solver, task: Task, flange_from_tool: Floats, features: Sequence[float]
    ) -> None:
        """Prepare a search.

        Args:
            robot: The nominal arm.
            solver: Of the arm that is solved for.
            task: What it meets.
            flange_from_tool: Transform (4, 4).
            features: Of the calibration, (F,).
        """
        has_branches = task == "pose" and robot.joint_count == POSE_JOINTS
        self._inverse = Inverse(robot) if has_branches else None
        self._solver, self._features = solver, features
        self._tool_from_flange = np.linalg.inv(flange_from_tool)

    def near(self, poses: Floats, seeds: Floats) -> tuple[Floats, Refused]:
        """Readings (n, N) for poses (n, 4, 4), NaN where refused, and why.

        Args:
            poses: base_from_tool.
            seeds: One for each pose, (n, N), or (N,) for the first, from which the others follow each other.
        """
        if seeds.ndim == 1 and self._inverse is not None:
            return self._follow(poses, seeds, self._inverse)
        found, refused = self._once(poses, seeds)
        if self._inverse is not None:
            self._again(poses, seeds, found, refused, self._inverse, nearest=False)
        return found, refused

    def _follow(self, poses: Floats, seed: Floats, inverse: Inverse) -> tuple[Floats, Refused]:
        """A path: in pieces, which double as long as all goes well."""
        found, refused = np.full((len(poses), len(seed)), np.nan), Refused()
        place, piece, last = 0, len(poses), seed
        while place < len(poses):
            readings, why = self._once(poses[place : place + piece], last)
            good = min(why, default=len(readings))
            found[place : place + good] = readings[:good]
            last, place, piece = readings[good - 1] if good > 0 else last, place + good, 2 * piece
            if why:
                here, left = slice(place, place + 1), {0: why[good]}
                self._again(poses[here], last[None], found[here], left, inverse, nearest=last is not seed)
                if left:
                    refused[place] = left[0]
                else:
                    last = found[place]
                place, piece = place + 1, 1
        return found, refused

    def _once(self, poses: Floats, seeds: Floats) -> tuple[Floats, Refused]:
        """As `near`, by the core's search and what it cannot see of branches."""
        found, _, refusals = self._solver.solve(poses, seeds, self._features)
        refused = {place: (code, reason) for place, code, reason in refusals}
        if self._inverse is not None:
            before = np.concatenate([seeds[None], found[:-1]]) if seeds.ndim == 1 else seeds
            (asked,) = np.nonzero(np.isfinite(found + before).all(axis=1))
            strays = asked[strayed(self._inverse, found[asked], before[asked])]
            refused.update(dict.fromkeys(strays.tolist(), BRANCH))
            found[strays] = np.nan
        return found, refused

    def _again(
        self,
        poses: Floats,
        seeds: Floats,
        found: Floats,
        refused: Refused,
        inverse: Inverse,
        *,
        nearest: bool,
    ) -> None:
        """Look once more for what is refused; what is found is entered, and no longer refused."""
        everything = inverse.method != NUMERIC
        places = [place for place, (code, _) in refused.items() if everything or code == BRANCH[0]]
        if not places:
            return
        begun = starts(inverse, poses[places] @ self._tool_from_flange, seeds[places], nearest=nearest)
        (tried,) = np.nonzero(np.isfinite(begun).all(axis=1))
        readings, still = self._once(poses[places][tried], begun[tried])
        for number, row in enumerate(tried.tolist()):
            if number not in still:
                found[places[row]] = readings[number]
                del refused[places[row]]
        for place in set(places) & set(refused):
            readings = self._from_both_sides(poses[place], seeds[place], inverse)
            if len(readings):
                found[place] = readings[0]
                del refused[place]

    def _from_both_sides(self, pose: Floats, seed: Floats, inverse: Inverse) -> Floats:
        """Readings (k, N) for a pose (4, 4), the nearest first, if the seed (N,) does not tell its side."""
        begun = beside(inverse, seed)
        readings, _ = self._once(np.tile(pose, (len(begun), 1, 1)), begun)
        readings = readings[np.isfinite(readings).all(axis=1)]
        readings = readings[~crossed(inverse, readings, np.tile(seed, (len(readings), 1)))]
        return np.asarray(readings[np.argsort(np.linalg.norm(readings - seed, axis=1))])
