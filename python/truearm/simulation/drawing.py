"""What of a virtual arm is drawn or follows from its robot file: errors of parameters, poses, set-up."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from truearm._core import Chain
from truearm.errors import InputError, did_you_mean
from truearm.fits.parameters import KINDS
from truearm.robot import Robot
from truearm.rotations import (
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_from_rotation_vector,
    transform_from_parts,
)
from truearm.simulation.imperfections import Imperfections
from truearm.types import Floats
from truearm.units import to_si

LENGTHS: Final = ("d", "a")


def default_parameters(robot: Robot) -> list[str]:
    """Names of theta, d, a and alpha of all links."""
    return [f"{kind}{row}" for row in range(1, robot.joint_count + 1) for kind in KINDS[:4]]


def nominal_rows(robot: Robot) -> Floats:
    """Nominal parameters (rows, 5) of the base, if given as a row, and of the links."""
    return robot.table if robot.base_row is None else np.vstack([robot.base_row, robot.table])


def row_chain(robot: Robot, rows: Floats, end: Floats) -> Chain:
    """The chain over the first `rows` (r, 5) that ends with the transform `end`."""
    if robot.base_row is None:
        return Chain(robot.convention, list(robot.joints[: len(rows)]), rows, robot.base, end)
    return Chain(robot.convention, ["fixed", *robot.joints[: len(rows) - 1]], rows, np.eye(4), end)


def draw_errors(
    robot: Robot, names: Sequence[str], imperfections: Imperfections, rng: np.random.Generator
) -> Floats:
    """Errors (rows, 5) of the named parameters, of the stated size, and of those with an amount of their own.

    Raises:
        InputError: If a name is not a parameter of this robot.
    """
    errors, places = np.zeros_like(nominal_rows(robot)), _places(robot)
    for name in names:
        place = _place(robot, name, places)
        sign = rng.choice([-1.0, 1.0])
        size = imperfections.length_mm if is_length(name) else imperfections.angle_deg
        errors[place] = amount_si(name, size) * (sign if imperfections.signs == "random" else 1.0)
    for name, amount in imperfections.stated.items():
        errors[_place(robot, name, places)] = amount_si(name, amount)
    return errors


def stated_rows(robot: Robot, amounts: Mapping[str, float]) -> Floats:
    """Amounts (rows, 5) in m and rad of named parameters, given in mm and deg; zero elsewhere.

    Raises:
        InputError: If a name is not a parameter of this robot.
    """
    rows, places = np.zeros_like(nominal_rows(robot)), _places(robot)
    for name, amount in amounts.items():
        rows[_place(robot, name, places)] = amount_si(name, amount)
    return rows


def is_length(name: str) -> bool:
    """Whether a parameter is a d or an a."""
    return name.rstrip("0123456789") in LENGTHS


def amount_si(name: str, amount: float) -> float:
    """An amount of a parameter, mm or deg, in m or rad."""
    return to_si(amount, "mm" if is_length(name) else "deg")


def joint_ranges(robot: Robot) -> tuple[Floats, Floats]:
    """Lowest and highest readings (N,); half a turn or half a metre where there is no limit."""
    return robot.finite_limits()


def direction(rng: np.random.Generator) -> Floats:
    """A unit vector (3,) of no preferred direction."""
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def random_transform(rng: np.random.Generator, distance_m: float) -> Floats:
    """A pose (4, 4) turned at random, so far from the origin."""
    quaternion = rng.normal(size=4)
    return transform_from_parts(distance_m * direction(rng), quaternion / np.linalg.norm(quaternion))


def turned(poses: Floats, rotation_vectors: Floats) -> Floats:
    """Quaternions (n, 4) of `poses` (n, 4, 4), each turned in the world by a rotation vector (n, 3)."""
    turns = matrix_from_quaternion(quaternion_from_rotation_vector(rotation_vectors))
    return quaternion_from_matrix(turns @ poses[:, :3, :3])


def _places(robot: Robot) -> dict[str, tuple[int, int]]:
    """Row and column of each parameter by name; rows are counted from 0 where the base is one of them."""
    first = 1 if robot.base_row is None else 0
    rows = range(robot.joint_count + 1 - first)
    return {f"{kind}{row + first}": (row, column) for row in rows for column, kind in enumerate(KINDS)}


def _place(robot: Robot, name: str, places: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
    if name not in places:
        raise InputError(
            f'{robot.name} has no parameter "{name}"',
            rule=f"It has theta, d, a, alpha and beta of each row: {next(iter(places))} and so on",
            way_out=did_you_mean(name, list(places)),
        )
    return places[name]
