"""Figure: what varies, as far as it follows weight on the joints, without saying that weight causes it."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.models import CONSTANT
from truearm.reporting.charts import axis, line, points, running_median
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import percent, short
from truearm.reporting.parts import Figure
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

POSES: Final = 800
BINS: Final = 10
FEWEST: Final = 15
UP: Final = np.array([0.0, 0.0, 1.0])


def sag(facts: Facts) -> Figure | None:
    """How much of what varies gives way downwards with the lever of each joint; None without a varying model.

    Each joint is asked for one stiffness: it turns by that times the moment of a unit weight at the measured
    point. The base is taken to stand upright.
    """
    if facts.best == CONSTANT or "prismatic" in facts.joints:
        return None
    poses = facts.drawn(POSES)
    moved = _moved_mm(facts, poses)
    basis, reach = _giving_way(facts, poses)
    share = _explained(basis.reshape(-1, len(facts.joints)), moved.reshape(-1))
    _, middles, medians = running_median(reach, moved[:, 2], BINS, FEWEST)
    drop = float(medians[-1] - medians[0])
    far, near = short(float(medians[-1]), float(medians[0]))
    direction = "lower" if drop < 0.0 else "higher"
    return Figure(
        "Vertical part of what varies",
        f"Far out the point lies {short(abs(drop))[0]} mm {direction} than close by, against the constant "
        f"model ({far} and {near} mm in the median). Joints that give way in proportion to the moment of "
        f"a weight at the point would explain {percent(share)} of what varies; other causes may look the "
        "same.",
        [
            points(reach, moved[:, 2], facts.best),
            line(middles, medians, facts.best, line={"color": "@ink", "width": 2}),
        ],
        {
            "xaxis": axis("distance from the base's z axis, mm"),
            "yaxis": axis("variable minus constant model, vertical, mm"),
        },
    )


def _moved_mm(facts: Facts, poses: Floats) -> Floats:
    """Where the varying model puts the measured point, less where the constant one does (n, 3), mm, centred.

    Both have their own frame and target; the difference is that of the points in the world of the first
    set-up, along the axes of the constant model's base.
    """
    calibration = facts.calibration
    chain = calibration.arm.chain(calibration.robot.flange)
    values, inputs = calibration.robot.joints_from_readings(poses), facts.inputs(poses)
    places = []
    for name in (facts.best, CONSTANT):
        model = calibration.models[name]
        pose = model.setup.frames[0] @ chain.pose(values, model.parameters(inputs))
        places.append(pose[:, :3, :3] @ model.setup.targets[0, 0] + pose[:, :3, 3])
    axes = calibration.models[CONSTANT].setup.frames[0][:3, :3]
    difference = MM_PER_METRE * (places[0] - places[1]) @ axes
    return np.asarray(difference - difference.mean(axis=0))


def _giving_way(facts: Facts, poses: Floats) -> tuple[Floats, Floats]:
    """Displacement (n, 3, N) for each joint's unit stiffness, without mean; distance from the axis, mm."""
    robot = facts.calibration.robot
    end = np.eye(4)
    end[:3, 3] = facts.point
    chain = facts.calibration.arm.chain(robot.flange @ end)
    values = robot.joints_from_readings(poses)
    jacobian = chain.joint_jacobian(values)
    moments = jacobian.transpose(0, 2, 1) @ UP
    basis = jacobian * -moments[:, None, :]
    place = chain.position(values)
    return basis - basis.mean(axis=0), MM_PER_METRE * np.linalg.norm(place[:, :2], axis=1)


def _explained(basis: Floats, moved: Floats) -> float:
    """Share of the variance that the best positive stiffnesses explain."""
    from scipy.optimize import nnls  # noqa: PLC0415

    found, _ = nnls(basis, moved)
    left = moved - basis @ found
    total = float(moved @ moved)
    return 1.0 - float(left @ left) / total if total > 0.0 else 0.0
