"""Limits of a URDF's joints, as they are meant."""

from typing import Any, Final

import numpy as np

from truearm.errors import InputError
from truearm.robot_checks import MAX_LENGTH_M, MAX_LIMIT_RAD

UNLIMITED: Final = 1000.0
"""From here, m or rad, a limit is a way to say that there is none."""


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
    lower, upper = (
        value if abs(value) < UNLIMITED else float(np.copysign(np.inf, value)) for value in (lower, upper)
    )
    _check_unit(joint.type, (lower, upper), where)
    return lower, upper


def _check_unit(kind: str, limits: tuple[float, float], where: str) -> None:
    largest = max(abs(value) for value in limits if np.isfinite(value)) if np.isfinite(limits).any() else 0.0
    sliding = kind == "prismatic"
    if largest <= (MAX_LENGTH_M if sliding else MAX_LIMIT_RAD):
        return
    unit, other, rule = (
        ("m", "millimetres", "divide them by 1000")
        if sliding
        else ("rad", "degrees", "multiply them by pi/180")
    )
    raise InputError(
        f"limits {limits[0]:g} to {limits[1]:g} {unit}",
        where=where,
        rule="A URDF is in m and rad",
        way_out=f"If these are {other}, {rule}; if the joint has none, leave lower and upper out",
    )
