"""A virtual arm on a wall, whose links are heavy and whose robot file does not say how it stands."""

import truearm as ta
from truearm.simulation import Deflection, Imperfections, Mass, VirtualArm


def on_a_wall():
    """Its variable calibration from 90 poses, and what was measured; up is the x axis of its base."""
    robot = ta.Robot.load("ur5e")
    masses = tuple(Mass(link, 8.0 / link) for link in range(2, robot.joint_count + 1))
    weak = Deflection((1e-5,) * robot.joint_count, masses, gravity_m_s2=(-9.81, 0.0, 0.0))
    arm = VirtualArm(robot, seed=3, imperfections=Imperfections(share=0.0, deflection=weak))
    data = arm.measure(arm.poses(90))
    return ta.calibrate(robot, data, use="position", refit=False), data
