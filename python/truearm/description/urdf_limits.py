"""Limits of a URDF's joints, as they are meant."""

from typing import Any, Final

import numpy as np

from truearm.description.robot_checks import MAX_LENGTH_M, MAX_LIMIT_RAD
from truearm.errors import InputError

UNLIMITED: Final = {"revolute": 1e3, "continuous": 1e3, "prismatic": 1e5}
"""From here, rad or m, a limit is a way to say that there is none; rails of some metres may be in mm."""


def joint_limits(joint: Any) -> tuple[float, float]:  # noqa: ANN401
    """Lowest and highest value of a joint that moves; infinite where there is none.

    Zero to zero is what CAD exporters write for limits that nobody filled in: there is none either.

    Raises:
        InputError: If the lower limit is not below the upper one, or a limit can only be of a wrong unit.
    """
    limit, where = joint.limit, f'joint "{joint.name}"'
    if joint.type == "continuous" or limit is None:
        return -np.inf, np.inf
    lower, upper = limit.lower or 0.0, limit.upper or 0.0
    if lower == upper == 0.0:
        return -np.inf, np.inf
    if lower >= upper:
        raise InputError(
            f"limits {lower:g} to {upper:g}", where=where, rule="The lower limit must be below the upper one"
        )
    none = UNLIMITED[joint.type]
    meant = -np.inf if lower <= -none else lower, np.inf if upper >= none else upper
    largest = max((abs(value) for value in meant if np.isfinite(value)), default=0.0)
    _check_unit(joint.type, largest, f"limits {lower:g} to {upper:g}", where)
    return meant


def _check_unit(kind: str, largest: float, stated: str, where: str) -> None:
    sliding = kind == "prismatic"
    if largest <= (MAX_LENGTH_M if sliding else MAX_LIMIT_RAD):
        return
    unit, other, rule = (
        ("m", "millimetres", "divide them by 1000")
        if sliding
        else ("rad", "degrees", "multiply them by pi/180")
    )
    raise InputError(
        f"{stated} {unit}",
        where=where,
        rule="A URDF is in m and rad",
        way_out=f"If these are {other}, {rule}; if the joint has none, leave lower and upper out",
    )
