"""What tools and work objects that were taught leave open of where a target is."""

import numpy as np

from truearm.programs.environment import Environment, Frame
from truearm.programs.program import Program
from truearm.programs.uses import Uses
from truearm.robot import Robot
from truearm.rotations import rigid_inverse, rigid_motion
from truearm.types import Floats, Integers
from truearm.units import MM_PER_METRE


def left_open_mm(
    program: Program, uses: Uses, which: Integers, q: Floats, robot: Robot, tool: Frame
) -> Floats:
    """Standard deviation that tool and work object leave of targets `which`, (n,), mm.

    The root of the sum of the variances of x, y and z, which counts the two as independent. A joint target
    has no work object. Zero where no frames file tells a covariance.

    Args:
        program: The program.
        uses: How its targets are used; each of `which` in an environment.
        which: Numbers of targets (n,).
        q: Readings that their author meant (n, N).
        robot: The programming model.
        tool: Their tool.
    """
    numbers, of_joints = uses.environment[which], uses.of_joints[which]
    of_tool = 0.0 if tool.covariance is None else float(np.trace(tool.covariance[:3, :3]))
    variance: Floats = np.full(len(which), of_tool)
    for number in np.unique(numbers).tolist():
        here = numbers == number
        environment = program.environments[number]
        posed = here & ~of_joints
        if environment.work_object.covariance is not None and posed.any():
            variance[posed] += _of_object(environment, environment.work_object.covariance, robot, q[posed])
    return MM_PER_METRE * np.sqrt(np.maximum(variance, 0.0))


def _of_object(environment: Environment, covariance: Floats, robot: Robot, q: Floats) -> Floats:
    """Variance of places on a work object, by its shift and by its turn about its origin, (n,), m^2."""
    here = environment.work_object
    flange = robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(q)))
    points = (rigid_inverse(here.controller) @ flange @ environment.tool.controller)[:, :3, 3]
    motion = rigid_motion(points @ here.true[:3, :3].T)
    variance: Floats = np.einsum("nij,jk,nik->n", motion, covariance, motion)
    return variance
