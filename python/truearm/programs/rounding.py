"""How far the rounding of a pose's numbers in the text may have moved the joints."""

from typing import Final

import numpy as np

from truearm.programs.layouts import PoseLayout, of_pose
from truearm.programs.program import Program, numbers_of
from truearm.programs.uses import Uses
from truearm.robot import Robot
from truearm.rotations import rotation_vector_from_matrix
from truearm.types import Floats, Integers

LENGTHS: Final = 3


def rounded_rad(program: Program, uses: Uses, which: Integers, q: Floats, robot: Robot) -> Floats:
    """How far from `q` at most the joints (n, N) may have been before the numbers were rounded, rad and m.

    To first order, with all numbers half a unit of their last digit off in the worst directions. Lengths
    count as written with the digits of the longest of them, and so do angles, or parts of a quaternion: the
    others may have lost zeros at their end.

    Args:
        program: The program.
        uses: How its targets are used; each of `which` in an environment.
        which: Numbers of Cartesian targets (n,); some may come several times.
        q: Readings that reach them (n, N).
        robot: The arm that reaches them.
    """
    values = np.ascontiguousarray(robot.joints_from_readings(q))
    jacobian = robot.flange_chain.joint_jacobian(values, pose=True) @ robot.coupling
    inverse = np.linalg.pinv(jacobian)
    moved = np.zeros(q.shape)
    numbers, environments = program.targets.layout[which], uses.environment[which]
    for number, layout in enumerate(program.layouts):
        for environment in np.unique(environments[numbers == number]).tolist():
            here = np.flatnonzero((numbers == number) & (environments == environment))
            if of_pose(layout):
                twists = _twists(program, which[here], layout, environment)
                moved[here] = np.abs(inverse[here] @ twists).sum(axis=2)
    return moved


def _twists(program: Program, which: Integers, layout: PoseLayout, environment: int) -> Floats:
    """Shift and turn of the flange (n, 6, K) by half a unit of each of a pose's K numbers, m and rad."""
    width = layout.width - layout.configuration
    values = numbers_of(program, which, layout)[:, :width]
    factors = program.targets.of(program.targets.factors, which, layout.width)[:, :width]
    decimals = np.array(program.targets.of(program.targets.decimals, which, layout.width)[:, :width])
    for part in (slice(0, LENGTHS), slice(LENGTHS, width)):
        decimals[:, part] = decimals[:, part].max(axis=1, keepdims=True)
    steps = 0.5 * np.abs(factors) * 10.0 ** -decimals.astype(np.float64)
    place = program.environments[environment].flange_poses
    here, twists = place(layout.to_poses(values)), np.empty((len(which), 6, width))
    for number in range(width):
        there = place(layout.to_poses(values + steps * (np.arange(width) == number)))
        twists[:, :3, number] = there[:, :3, 3] - here[:, :3, 3]
        turns = there[:, :3, :3] @ np.swapaxes(here[:, :3, :3], 1, 2)
        twists[:, 3:, number] = rotation_vector_from_matrix(turns)
    return twists
