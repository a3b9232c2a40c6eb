"""A virtual arm as JSON values and as a TOML file.

robot = "rv-m2"                     # library name, file, or the text of a robot file
seed = 3
parameters = ["theta1", "a2"]       # those that err by drawn amounts

[imperfections]
noise_mm = 0.02
stated = { d1 = 0.3, theta2 = -0.1 }

[[imperfections.joint_errors]]
joint = 2
backlash_deg = 0.01
harmonics = [{ order = 100, amplitude_deg = 0.005 }]
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import tomli_w
from pydantic import TypeAdapter, ValidationError

from truearm.errors import InputError, UsageError, did_you_mean
from truearm.robot import Robot
from truearm.simulation.imperfections import Imperfections

KEYS: Final = ("robot", "seed", "parameters", "imperfections")


def describe(robot: Robot, seed: int, imperfections: Imperfections, names: Sequence[str]) -> dict[str, Any]:
    """JSON values of an arm; the robot as the text of a robot file."""
    content = {name: value for name, value in asdict(imperfections).items() if value is not None}
    return {"robot": robot.to_toml(), "seed": seed, "parameters": list(names), "imperfections": content}


def write(content: Mapping[str, Any]) -> str:
    """The text of a TOML file."""
    return tomli_w.dumps(content, multiline_strings=True)


def arguments(content: Mapping[str, Any], *, where: str) -> dict[str, Any]:
    """Arguments of VirtualArm.

    Raises:
        InputError: If a key is not known or missing, or a value breaks a rule; names the key.
    """
    for name in content:
        if name not in KEYS:
            raise InputError(f'unknown key "{name}"', where=where, rule=did_you_mean(name, KEYS) or _known())
    if "robot" not in content:
        raise InputError('key "robot" is missing', where=where, rule="A library name or a robot file")
    try:
        return {
            "robot": _robot(str(content["robot"]), where),
            "seed": TypeAdapter(int).validate_python(content.get("seed", 0)),
            "parameters": TypeAdapter(list[str] | None).validate_python(content.get("parameters")),
            "imperfections": TypeAdapter(Imperfections).validate_python(content.get("imperfections", {})),
        }
    except UsageError as error:
        raise InputError(error.what, where=f"{where}, {error.where}", rule=error.rule) from None
    except ValidationError as error:
        detail = error.errors(include_url=False)[0]
        place = ", ".join(str(part + 1) if isinstance(part, int) else part for part in detail["loc"])
        message = f"{detail['msg']}, and not {detail['input']!r:.60}"
        raise InputError(message, where=f"{where}, {place}" if place else where) from None


def _robot(given: str, where: str) -> Robot:
    return Robot.from_toml(given, where=f"{where}, robot") if "\n" in given else Robot.load(given)


def _known() -> str:
    return f"Known here: {', '.join(KEYS)}"
