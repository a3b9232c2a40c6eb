"""Poses that a calibration proposes, in a good order: to learn more, or to check that it still holds."""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.cell.cell_file import Cell
from truearm.cell.motion import Motion, Passage
from truearm.cell.plan import (
    LEAST_POOL,
    POOL_PER_POSE,
    in_order,
    measurable_pool,
    orders_of,
    seconds_of,
    targets_of,
)
from truearm.cell.poses_file import Poses
from truearm.cell.reaching import within_reach
from truearm.defaults import THERE_AND_BACK
from truearm.errors import UsageError
from truearm.fits.endpoints import at_target
from truearm.fits.stillness import still_joints
from truearm.measurements import Measurements
from truearm.planning.accessibility import Rule
from truearm.proposing import (
    Acceptance,
    Candidates,
    NextPoses,
    acceptance_poses,
    expected_by_update,
    next_poses,
)
from truearm.robot import Robot
from truearm.types import Floats
from truearm.updating import UpdateOptions

WORKSPACE: Final = 300
"""Poses at which the expected error counts."""
MOST_CANDIDATES: Final = 600
MOST_PROPOSED: Final = 200
"""More add nothing to a plan, and memory grows with the square of the candidates."""


@dataclass(frozen=True)
class ProposalOptions:
    """What is proposed.

    Attributes:
        count: How many poses.
        seed: Seed of the candidates, and of the workspace.
        order: "there-and-back", "short" or "paper".
        group: Set-up in which they will be measured; the calibration's last one by default.
        rules: What every pose has to keep to, of truearm.planning.accessibility or functions like these, with
            each target that the calibration found in the set-up, or the cell's.
        update_of: The calibration that will be updated from the next poses; None where one is made from all.
        update_rows: What was measured since that one, which takes part.
        update_options: How it will be updated; the defaults without.
        link_radius_mm: Half the thickness of links that are not to meet; 0 where they may, the cell's, or 40,
            by default.
    """

    count: int
    seed: int = 0
    order: str = THERE_AND_BACK
    group: str | None = None
    rules: tuple[Rule, ...] = ()
    update_of: Calibration | None = None
    update_rows: tuple[Measurements, ...] = ()
    update_options: UpdateOptions | None = None
    link_radius_mm: float | None = None


@dataclass(frozen=True, eq=False)
class Proposed:
    """Proposed poses in their order.

    Attributes:
        poses: With purpose "train" or "acceptance", approached from both sides in turn.
        points: The first of these targets in the base frame (n, 3), m.
        seconds: Time of the motions of the joints in each order by name.
        found: What was chosen, and what is expected of it.
        shown: What each pose is taken to be measured with, in words.
        passage: How the arm gets from pose to pose.
    """

    poses: Poses
    points: Floats
    seconds: dict[str, float]
    found: NextPoses | Acceptance
    shown: str
    passage: Passage

    @property
    def teaches(self) -> bool:
        """Whether less is uncertain once the poses are measured, as far as that can be told."""
        return not isinstance(self.found, NextPoses) or self.found.teach

    def to_dict(self) -> dict[str, Any]:
        """JSON values: motion times, and the expected deviations or what is noticed."""
        told: dict[str, Any] = {
            "count": len(self.poses),
            "motion_s": self.seconds,
            **self.passage.to_dict(),
            "measured": self.shown,
        }
        if isinstance(self.found, NextPoses):
            expected = self.found.expected_mm
            return told | {
                "expected_before_mm": float(expected[0]),
                "expected_after_mm": expected[1:].tolist(),
            }
        return told | {
            "noticed": self.found.noticed,
            "alike": self.found.alike,
            "information_nat": self.found.information[1:].tolist(),
        }


def propose_next(calibration: Calibration, options: ProposalOptions, *, cell: Cell | None = None) -> Proposed:
    """The poses that reduce the expected error over what can be measured most.

    Args:
        calibration: What is known already.
        options: How many.
        cell: Cell whose sensor has to reach the poses; joint limits alone without one.

    Raises:
        WorkError: If the sensor reaches too few poses, or the calibration has no standard deviations.
    """
    motion = _motion(calibration, options, cell)
    candidates = _candidates(calibration, options, motion)
    workspace = measurable_pool(motion, WORKSPACE, options.seed + 1, _held(calibration))
    found = next_poses(candidates, workspace, options.count)
    if options.update_of is not None:
        chosen = replace(candidates, readings=candidates.readings[found.rows])
        known = options.update_of, options.update_rows, options.update_options
        expected = expected_by_update(chosen, workspace, *known)
        found = replace(found, expected_mm=expected)
    proposed = _ordered(candidates, found, found.rows, "train", options, motion)
    return replace(proposed, poses=replace(proposed.poses, group=candidates.set_up))


def propose_acceptance(
    calibration: Calibration, options: ProposalOptions, *, cell: Cell | None = None
) -> Proposed:
    """The poses that check the calibration best; arguments and errors as for propose_next."""
    motion = _motion(calibration, options, cell)
    candidates = _candidates(calibration, options, motion)
    found = acceptance_poses(candidates, options.count)
    return _ordered(candidates, found, found.rows, "acceptance", options, motion)


def kept_still(calibration: Calibration) -> dict[int, float]:
    """Joints with one reading in all measurements, as without a motor: proposed poses keep it.

    Returns:
        The reading, deg or mm, by the number of the joint from 1.
    """
    rows = calibration.learned_from
    if rows is None:
        return {}
    readings = rows.data.readings
    alike = np.ptp(readings, axis=0) == 0.0
    still = still_joints(readings, calibration.robot.joints)
    return {joint: at for joint, at in still.items() if alike[joint - 1]}


def _held(calibration: Calibration) -> dict[int, float]:
    """Readings, rad or m, of these joints by the number of the joint from 1."""
    rows = calibration.learned_from
    if rows is None:
        return {}
    return {joint: float(rows.data.readings[0, joint - 1]) for joint in kept_still(calibration)}


def check_same_arm(calibration: Calibration, arm: Robot) -> None:
    """Raise UsageError where a calibration is of another arm."""
    check_same_tables(arm, calibration.robot, f"the calibration is of {calibration.robot.name}")


def check_same_tables(arm: Robot, known: Robot, whose: str) -> None:
    """Raise UsageError, which says whose the known one is, where two arms have different tables."""
    if known.table.shape != arm.table.shape or not np.allclose(known.table, arm.table):
        raise UsageError(
            whose,
            rule=f"The poses are for {arm.name}, whose Denavit-Hartenberg table is another",
            way_out=f"Name {known.name}, or the robot's own file",
        )


def _candidates(calibration: Calibration, options: ProposalOptions, motion: Motion) -> Candidates:
    if options.count > MOST_PROPOSED:
        raise UsageError(
            f"{options.count} poses",
            rule=f"At most {MOST_PROPOSED} are proposed at a time",
            way_out="Measure some, calibrate and ask again, or plan afresh with truearm plan ROBOT -n N",
        )
    size = min(max(LEAST_POOL, POOL_PER_POSE * options.count), MOST_CANDIDATES)
    pool = measurable_pool(motion, size, options.seed, _held(calibration))
    return Candidates(calibration, pool, options.group)


def _motion(calibration: Calibration, options: ProposalOptions, cell: Cell | None) -> Motion:
    """The motion within the rules, which are kept to with each target that is measured."""
    tools = _tools(calibration, options.group, cell)
    return Motion.of(calibration.robot, cell, options.rules, tools, options.link_radius_mm)


def _tools(calibration: Calibration, group: str | None, cell: Cell | None) -> list[Floats]:
    """Transforms (4, 4) from the flange to what is measured: the cell's target, else those that the
    calibration found in a set-up; the arm's own tool where it found none.
    """
    if cell is not None:
        return [cell.flange_from_target]
    known, selection = calibration.groups, calibration.selection
    group = known[-1] if group is None else group
    if group not in known:
        return [calibration.robot.tool]
    held = calibration.measured.targets[known.index(group)]
    ends = [
        at_target(calibration, None, group, target + 1).flange_from_end
        for target, count in zip(selection.targets, held, strict=False)
        if count
    ]
    return [end for end in ends if np.isfinite(end).all()] or [calibration.robot.tool]


def _ordered(
    candidates: Candidates,
    found: NextPoses | Acceptance,
    rows: NDArray[np.int64],
    purpose: str,
    options: ProposalOptions,
    motion: Motion,
) -> Proposed:
    arm = candidates.calibration.robot
    readings = candidates.readings[rows]
    tools = motion.tools
    points = targets_of(arm, readings, tools[0])
    orders = orders_of(points, readings)
    lists = {name: in_order(readings, [purpose] * len(rows), each, 0)[0] for name, each in orders.items()}
    lists[options.order], unreached = within_reach(motion, lists[options.order])
    poses, seconds = lists[options.order], {name: seconds_of(each) for name, each in lists.items()}
    return Proposed(
        poses,
        targets_of(arm, poses.readings, tools[0]),
        seconds,
        found,
        candidates.shown,
        motion.passage(poses, unreached),
    )
