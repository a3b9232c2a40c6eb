"""A Robot as JSON values, and back, bit for bit."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.arrays import as_numbers, as_transforms
from truearm.description.robot_data import TRANSFORMS, Payload, RobotData
from truearm.description.urdf_names import UrdfNames
from truearm.errors import InputError

TEXTS: Final = ("name", "source", "convention")
ARRAYS: Final = ("table", *TRANSFORMS, "coupling")


def to_dict(robot: RobotData) -> dict[str, Any]:
    """All fields as JSON values; an absent limit is null."""
    content: dict[str, Any] = {key: getattr(robot, key) for key in TEXTS}
    content["joints"] = list(robot.joints)
    content |= {key: getattr(robot, key).tolist() for key in ARRAYS}
    content["base_row"] = None if robot.base_row is None else robot.base_row.tolist()
    content["limits"] = [[_finite_or_none(bound) for bound in row] for row in robot.limits.tolist()]
    payload = robot.payload
    content["payload"] = None
    if payload is not None:
        centre = payload.centre_of_gravity_mm
        content["payload"] = {
            "mass_kg": payload.mass_kg,
            "centre_of_gravity_mm": None if centre is None else list(centre),
        }
    if robot.urdf_names is not None:
        content["urdf_names"] = asdict(robot.urdf_names)
    return content


def fields_of(content: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a Robot from what to_dict gave.

    Raises:
        InputError: If a key is missing, an array holds something else than numbers, or a transform is not
            rigid.
    """
    keys = (*(key for key in TEXTS if key != "source"), *ARRAYS, "joints", "base_row", "limits", "payload")
    missing = [key for key in keys if key not in content]
    if missing:
        raise InputError(f'key "{missing[0]}" is missing', where="robot")
    fields: dict[str, Any] = {key: content.get(key, "") for key in TEXTS}
    fields |= {key: as_numbers(content[key], what=f"values of {key}") for key in ("table", "coupling")}
    fields |= {key: as_transforms([content[key]], what=f"values of {key}")[0][0] for key in TRANSFORMS}
    fields["joints"] = tuple(content["joints"])
    row = content["base_row"]
    fields["base_row"] = None if row is None else as_numbers(row, what="values of base_row")
    fields["limits"] = _limits(content["limits"])
    payload = content["payload"]
    if payload is not None:
        centre = payload["centre_of_gravity_mm"]
        payload = Payload(payload["mass_kg"], None if centre is None else tuple(centre))
    fields["payload"] = payload
    names = content.get("urdf_names")
    if names is not None:
        joints, links = tuple(names["joints"]), tuple(names["links"])
        fields["urdf_names"] = UrdfNames(names["base_link"], joints, links, names["tip_link"])
    return fields


def _finite_or_none(bound: float) -> float | None:
    return bound if np.isfinite(bound) else None


def _limits(rows: list[list[float | None]]) -> NDArray[np.float64]:
    lower = [-np.inf if low is None else low for low, _ in rows]
    upper = [np.inf if high is None else high for _, high in rows]
    return np.column_stack([lower, upper]).astype(np.float64)
