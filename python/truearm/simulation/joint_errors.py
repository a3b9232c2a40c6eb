"""Errors of joints: their gears, encoders and play, and what gives way under weight."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from truearm._core import Chain
from truearm.errors import InputError
from truearm.robot import Robot
from truearm.simulation.imperfections import Deflection, JointError
from truearm.types import Floats

ChainTo = Callable[[int, Floats], Chain]


def check_joints(robot: Robot, errors: Sequence[JointError], deflection: Deflection | None) -> None:
    """Raise InputError where an error names a joint or link that the arm does not have."""
    count = robot.joint_count
    for error in errors:
        if not 1 <= error.joint <= count:
            raise InputError(
                f"joint {error.joint}", where="joint_errors", rule=f"{robot.name} has 1 to {count}"
            )
        if robot.joints[error.joint - 1] != "revolute":
            raise InputError(
                f"joint {error.joint} slides", where="joint_errors", rule="Only turning joints err so"
            )
    if deflection is None:
        return
    if len(deflection.compliance) != count:
        raise InputError(
            f"{len(deflection.compliance)} compliances",
            where="deflection",
            rule=f"{robot.name} has {count} joints",
        )
    for mass in deflection.masses:
        if not 1 <= mass.link <= count:
            raise InputError(f"link {mass.link}", where="deflection", rule=f"{robot.name} has 1 to {count}")


def joint_errors(errors: Sequence[JointError], readings: Floats, approach: ArrayLike | None) -> Floats:
    """Errors (n, N) of readings (n, N), rad: harmonics, eccentricity and the lag of play."""
    found = np.zeros_like(readings)
    signs = np.zeros_like(readings) if approach is None else np.broadcast_to(approach, readings.shape)
    for error in errors:
        column = error.joint - 1
        angle = readings[:, column]
        for harmonic in error.harmonics:
            phase = np.deg2rad(harmonic.phase_deg)
            found[:, column] += np.deg2rad(harmonic.amplitude_deg) * np.sin(harmonic.order * angle + phase)
        eccentric = np.sin(angle + np.deg2rad(error.eccentricity_phase_deg))
        found[:, column] += np.deg2rad(error.eccentricity_deg) * eccentric
        found[:, column] -= np.deg2rad(error.backlash_deg) / 2.0 * signs[:, column]
    return found


def sagging(
    deflection: Deflection, chain_to: ChainTo, links: int, values: Floats, payload_kg: ArrayLike
) -> Floats:
    """What the joints give way (n, N), rad or m.

    The torque of a mass about a joint is gravity times the derivative of the mass's place.

    Args:
        deflection: Compliances and masses.
        chain_to: Chain that ends with a link (from 1) and a transform behind it.
        links: How many links, N.
        values: Denavit-Hartenberg joint values (n, N).
        payload_kg: At the flange, a number or (n,).
    """
    gravity = np.array(deflection.gravity_m_s2)
    torque = np.zeros_like(values)
    for mass in deflection.masses:
        chain = chain_to(mass.link, _at(mass.at_m))
        jacobian = chain.joint_jacobian(np.ascontiguousarray(values[:, : mass.link]))
        torque[:, : mass.link] += mass.kg * (gravity @ jacobian)
    payload = np.broadcast_to(np.asarray(payload_kg, dtype=np.float64), len(values))
    if np.any(payload != 0.0):
        chain = chain_to(links + 1, _at(deflection.payload_at_m))
        torque += payload[:, None] * (gravity @ chain.joint_jacobian(values))
    return np.asarray(torque * np.array(deflection.compliance))


def _at(point: Sequence[float]) -> Floats:
    transform = np.eye(4)
    transform[:3, 3] = point
    return transform
