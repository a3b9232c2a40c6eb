"""How many held-out measurements lie within the 95 % intervals that a calibration gave before it saw them."""

import numpy as np

import truearm as ta
from truearm.splitting import split_rows
from truearm.uncertainty import VariableSpread

NORMAL_95 = 1.959964


def coverage(calibration, data):
    """Share of the coordinates (base frame, target 1) of held-out rows that lie within their 95 % interval.

    Args:
        calibration: A variable calibration that was not fitted again to all rows.
        data: The measurements it was made from.
    """
    rows = data.select(split_rows(data, calibration.options.split).holdout)
    spread = VariableSpread.of(calibration)
    inside = [_inside(calibration, spread, rows, number) for number in range(len(calibration.groups))]
    return float(np.concatenate(inside).mean())


def _inside(calibration, spread, rows, number):
    """Whether each coordinate (n, 3) of the rows of one set-up lies within its interval."""
    group, setup, robot = calibration.groups[number], calibration.model.setup, calibration.robot
    chosen = rows.group == group
    q, measured = rows.readings[chosen], rows.targets[chosen, 0]
    missed = (measured - calibration.position(q, group=group, target=1)) @ setup.frames[number][:3, :3]
    point = setup.targets[number, 0]
    jacobian = calibration.parameter_jacobian(q, tool=point)
    of_setup = _setup_jacobian(calibration, q, number)
    inputs = robot.joints_from_readings(q)
    covariance = spread.posterior.covariance(inputs, jacobian[:, :, spread.columns], of_setup)
    variance = np.einsum("nii->ni", covariance) + calibration.variable.unexplained_m**2
    return np.abs(missed) <= NORMAL_95 * calibration.variable.inflation * np.sqrt(variance)


def _setup_jacobian(calibration, q, number):
    """Derivative (n, 3, s) of the predicted minus the measured point, in the base, by the set-ups' unknowns.

    Of each group: translation and rotation of world_from_base, from the right, then the target points.
    """
    setup = calibration.model.setup
    width = 6 + 3 * setup.targets.shape[1]
    jacobian = np.zeros((len(q), 3, width * len(calibration.groups)))
    mine = jacobian[:, :, number * width :]
    x, y, z = calibration.position(q, tool=setup.targets[number, 0]).T
    zero = np.zeros_like(x)
    mine[:, :, :3] = np.eye(3)
    mine[:, :, 3:6] = -np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), -1, 0)
    mine[:, :, 6:9] = calibration.pose(q, tool=np.eye(4))[:, :3, :3]
    return jacobian


def coverage_of_file(path, files):
    """Coverage of a calibration file and the measurement files it was made from."""
    calibration = ta.Calibration.load(path)
    robot = calibration.robot
    return coverage(calibration, ta.Measurements.read_files(files, joints=robot.joints).deduplicated())
