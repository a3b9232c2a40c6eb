"""Figure: what varies vertically, and how far it follows the levers of the links, without naming a cause."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from truearm._core import Chain, non_negative_least_squares
from truearm.doubts.of_results import UPRIGHT
from truearm.fits.models import CONSTANT
from truearm.reporting.charts import axis, line, points, running_median
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import HARDLY_ANY, percent, short
from truearm.reporting.parameters import chain_to_point
from truearm.reporting.parts import Figure
from truearm.rotations import rigid_motion
from truearm.types import Floats
from truearm.units import MM_PER_METRE

POSES: Final = 800
BINS: Final = 10
FEWEST: Final = 15
STANDS_OUT: Final = 2.0
LEAST: Final = 0.1
"""Vertical levers stand out that explain so many times what horizontal ones do, and this share at least."""
RANK: Final = 1e-9
"""Directions of the constants that reach no farther than this share of the farthest are none."""


def sag(facts: Facts) -> Figure | None:
    """How far what varies follows the levers of the links about the joints; None without a varying model.

    Each joint is asked for one compliance a link behind it: it turns by that times the lever of a weight at
    the link's end. What the constants, frame and target can take over is no part of either side. The same
    levers for horizontal directions tell what so many curves explain by themselves.
    """
    if facts.best == CONSTANT or "prismatic" in facts.joints:
        return None
    poses, up = facts.drawn(POSES), _up(facts)
    taken = _taken_over(facts, poses)
    moved = _without(taken, _moved_mm(facts, poses).reshape(-1))
    share, other = (
        max(_explained(_without(taken, _giving_way(facts, poses, way)), moved) for way in ways)
        for ways in ([up], _across(up))
    )
    reach, height = _reach_mm(facts, poses, up), moved.reshape(-1, 3) @ up
    _, middles, medians = running_median(reach, height, BINS, FEWEST)
    near, far = short(float(medians[0]), float(medians[-1]))
    return Figure(
        "Vertical deviation, beyond what constants can take over",
        f"Its median is {near} mm close to the base and {far} mm far out. Vertical levers of the "
        f"links about the joints would explain {percent(share)} of the variance of all three coordinates, "
        f"horizontal ones {_at_most(other)}. {_verdict(facts, moved, share, other)}.",
        [
            points(reach, height, facts.best),
            line(middles, medians, facts.best, line={"color": "@ink", "width": 2}),
        ],
        {
            "xaxis": axis("distance from the vertical through the base, mm"),
            "yaxis": axis("vertical deviation, mm"),
        },
    )


def _at_most(share: float) -> str:
    said = percent(share)
    return said if said == HARDLY_ANY else f"up to {said}"


def _verdict(facts: Facts, moved: Floats, share: float, other: float) -> str:
    """Whether vertical levers stand out, and whether there is enough to tell."""
    if np.sqrt(np.square(moved).mean()) < facts.summary["noise_mm"]:
        return "What varies is smaller than the noise, so this says little"
    if share > STANDS_OUT * other and share > LEAST:
        return "Vertical levers stand out"
    return "These data do not set vertical levers apart"


def _up(facts: Facts) -> Floats:
    """The vertical in the base frame: as the calibration found it, else the base's z axis."""
    details = facts.calibration.variable
    return np.array(UPRIGHT if details is None else details.hyper.get("up", UPRIGHT), dtype=np.float64)


def _across(up: Floats) -> list[Floats]:
    """Four horizontal directions."""
    first, second = np.linalg.svd(up[None])[2][1:]
    return [first, -first, second, -second]


def _moved_mm(facts: Facts, poses: Floats) -> Floats:
    """Where the varying model puts the measured point, less where the constant one does (n, 3), mm.

    Both have their own frame and target; the difference is that of the points in the world of the first
    set-up, along the axes of the constant model's base.
    """
    calibration = facts.calibration
    chain = calibration.arm.chain(calibration.robot.flange)
    values, inputs = calibration.robot.joints_from_readings(poses), facts.inputs(poses)
    places, target = [], calibration.measured.first(0)
    for name in (facts.best, CONSTANT):
        model = calibration.models[name]
        pose = model.setup.frames[0] @ chain.pose(values, model.parameters(inputs))
        places.append(pose[:, :3, :3] @ model.setup.targets[0, target] + pose[:, :3, 3])
    axes = calibration.models[CONSTANT].setup.frames[0][:3, :3]
    return np.asarray(MM_PER_METRE * (places[0] - places[1]) @ axes)


def _taken_over(facts: Facts, poses: Floats) -> Floats:
    """Orthonormal directions (3 n, k) of what constants, frame and target do to the measured point."""
    arm, robot = facts.calibration.arm, facts.calibration.robot
    values, chain = robot.joints_from_readings(poses), chain_to_point(facts)
    pose = chain.pose(values)
    constants = chain.parameter_jacobian(values)[:, :, list(arm.candidates.columns)]
    columns = np.concatenate([constants, rigid_motion(pose[:, :3, 3]), pose[:, :3, :3]], axis=2)
    directions, sizes, _ = np.linalg.svd(columns.reshape(-1, columns.shape[2]), full_matrices=False)
    return np.asarray(directions[:, sizes > RANK * sizes[0]])


def _without(directions: Floats, values: Floats) -> Floats:
    return np.asarray(values - directions @ (directions.T @ values))


def _giving_way(facts: Facts, poses: Floats, up: Floats) -> Floats:
    """Displacement (3 n, c) of the measured point: joints comply with the levers of links behind them."""
    values = facts.calibration.robot.joints_from_readings(poses)
    moved = chain_to_point(facts).joint_jacobian(values)
    found = []
    for link in _links(facts):
        behind = link.joint_count
        levers = up @ link.joint_jacobian(np.ascontiguousarray(values[:, :behind]))
        found.append(-moved[:, :, :behind] * levers[:, None, :])
    return np.concatenate(found, axis=2).reshape(-1, sum(part.shape[2] for part in found))


def _links(facts: Facts) -> Iterator[Chain]:
    """The chain to the end of each link."""
    robot = facts.calibration.robot
    for count in range(1, robot.joint_count + 1):
        table = robot.table[:count].copy()
        yield Chain(robot.convention, list(robot.joints[:count]), table, robot.base, np.eye(4))


def _reach_mm(facts: Facts, poses: Floats, up: Floats) -> Floats:
    """Distance of the measured point from the vertical through the base's origin (n,)."""
    place = chain_to_point(facts).position(facts.calibration.robot.joints_from_readings(poses))
    return np.asarray(MM_PER_METRE * np.linalg.norm(place - np.outer(place @ up, up), axis=1))


def _explained(basis: Floats, moved: Floats) -> float:
    """Share of the variance that the best compliances, none of them negative, explain."""
    left = moved - basis @ non_negative_least_squares(basis, moved)
    total = float(moved @ moved)
    return 1.0 - float(left @ left) / total if total > 0.0 else 0.0
