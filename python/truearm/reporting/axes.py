"""What the model varies along: readings of joints, or Denavit-Hartenberg values where joints are coupled."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from truearm.reporting.facts import OUTER, Facts
from truearm.reporting.numbers import listed
from truearm.types import Floats


@dataclass(frozen=True)
class JointAxis:
    """What of a joint differs while everything else stays.

    Attributes:
        joint: Number of the joint, from 0.
        name: "joint 3", "D-H value of joint 3" or "reading 3".
        of_value: Whether it is the joint's Denavit-Hartenberg value while those of the others stay, so that
            readings of coupled joints move with it; else it is the joint's reading.
    """

    joint: int
    name: str
    of_value: bool = False


def coupled_joints(facts: Facts) -> list[int]:
    """Joints, from 0, whose reading turns another joint, or that another reading turns."""
    others = facts.calibration.robot.coupling * (1.0 - np.eye(len(facts.joints)))
    return np.flatnonzero(others.any(axis=0) | others.any(axis=1)).tolist()


def joints_over_readings(facts: Facts) -> list[int]:
    """Coupled joints, from 0, whose curves go with readings."""
    blocks = [block for block in facts.summary["blocks"] if block.get("over_reading")]
    return sorted({joint - 1 for block in blocks for joint in block["joints"]})


def input_axis(facts: Facts, joint: int) -> JointAxis:
    """What the field has for an input of a joint: its value, which is its reading where none is coupled."""
    if joint in coupled_joints(facts):
        return JointAxis(joint, f"D-H value of joint {joint + 1}", of_value=True)
    return JointAxis(joint, f"joint {joint + 1}")


def curve_axis(facts: Facts, joint: int) -> JointAxis:
    """What the curves of a joint are drawn along: its input, or its reading where curves go with readings."""
    if joint in joints_over_readings(facts):
        return JointAxis(joint, f"reading {joint + 1}")
    return input_axis(facts, joint)


def ends(facts: Facts, along: JointAxis) -> tuple[float, float]:
    """The usual range of what an axis is of, rad or m."""
    if not along.of_value:
        low, high = facts.span[along.joint].tolist()
        return low, high
    robot = facts.calibration.robot
    if facts.readings is not None:
        values = robot.joints_from_readings(facts.readings)[:, along.joint]
        low, high = np.quantile(values, [OUTER, 1.0 - OUTER]).tolist()
        return low, high
    parts = robot.coupling[along.joint] * facts.span.T
    return float(parts.min(axis=0).sum()), float(parts.max(axis=0).sum())


def places(facts: Facts, along: JointAxis, count: int) -> Floats:
    """Values (count,) from end to end of the usual range."""
    return np.linspace(*ends(facts, along), count)


def readings_at(facts: Facts, base: Floats, values: Mapping[JointAxis, Floats]) -> Floats:
    """Readings (s, N) that are those of `base` (N,) but for values (s,) along some axes."""
    robot = facts.calibration.robot
    readings = np.repeat(base[None], len(next(iter(values.values()))), axis=0)
    for along, wanted in values.items():
        if not along.of_value:
            readings[:, along.joint] = wanted
    if not any(along.of_value for along in values):
        return readings
    held = robot.joints_from_readings(readings)
    for along, wanted in values.items():
        if along.of_value:
            held[:, along.joint] = wanted
    return np.asarray(robot.readings_from_joints(held))


def coupling_words(facts: Facts) -> str:
    """What curves along coupled joints go along, after a blank; empty where no joints are coupled."""
    coupled, over = coupled_joints(facts), joints_over_readings(facts)
    if not coupled:
        return ""
    words = (
        f" The readings of {_named(coupled)} are coupled, and parameters vary with their "
        "Denavit-Hartenberg (D-H) values: along one of these, those of the other joints stay, so that "
        "several readings move."
    )
    if over:
        words += (
            f" What the drives leave goes with readings, so the curves of {_named(over)} are along one "
            "reading, which moves several D-H values."
        )
    return words


def _named(joints: list[int]) -> str:
    numbers = listed([str(joint + 1) for joint in joints])
    return f"joint{'s' if len(joints) > 1 else ''} {numbers}"
