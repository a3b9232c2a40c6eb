"""The constant part as a Denavit-Hartenberg table: a robot file, JSON or CSV."""

import csv
import io
import json
from typing import Any, Final

import numpy as np

from truearm.exporting.losses import LINK_ORDER, as_comments
from truearm.exporting.parity import checked, flange_poses
from truearm.fits.parameters import KINDS
from truearm.robot import Robot

UNITS: Final = ("rad", "m", "m", "rad", "rad")
COLUMNS: Final = tuple(f"{kind}_{unit}" for kind, unit in zip(KINDS, UNITS, strict=True))


def toml_text(robot: Robot, notes: list[str]) -> tuple[str, float]:
    """A robot file that `truearm` reads, m and rad, and how far it is from the robot read again, m.

    Raises:
        WorkError: If the text read again is not the robot.
    """
    text = as_comments(notes) + robot.to_toml()
    again = Robot.from_toml(text, where="the robot file")
    return text, checked(robot, lambda q: flange_poses(again, q), "the robot file")


def json_text(robot: Robot, nominal: Robot, notes: list[str]) -> tuple[str, float]:
    """JSON with all fields of the robot, the nominal table and the notes; and the same check.

    Raises:
        WorkError: If the text read again is not the robot.
    """
    content: dict[str, Any] = {
        "notes": notes,
        "columns": list(COLUMNS),
        **robot.to_dict(),
        "nominal_table": nominal.table.tolist(),
    }
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    again = Robot.from_dict(json.loads(text))
    return text, checked(robot, lambda q: flange_poses(again, q), "the JSON")


def csv_text(robot: Robot, nominal: Robot, notes: list[str]) -> tuple[str, float]:
    """CSV with a row a link: parameters and nominal parameters; fixed transforms are in its comments.

    Raises:
        WorkError: If the text read again is not the robot.
    """
    file = io.StringIO()
    file.write(as_comments([*notes, *_frame_notes(robot)]))
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["link", "joint", *COLUMNS, *(f"nominal_{column}" for column in COLUMNS)])
    rows = zip(robot.joints, robot.table.tolist(), nominal.table.tolist(), strict=True)
    writer.writerows([number, joint, *ours, *theirs] for number, (joint, ours, theirs) in enumerate(rows, 1))
    text = file.getvalue()
    again = Robot.from_dict({**robot.to_dict(), "table": _read_table(text)})
    return text, checked(robot, lambda q: flange_poses(again, q), "the CSV")


def _read_table(text: str) -> list[list[float]]:
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return [[float(row[column]) for column in COLUMNS] for row in csv.DictReader(lines)]


def _frame_notes(robot: Robot) -> list[str]:
    order = LINK_ORDER[robot.convention]
    notes = [f"{robot.name}, {robot.source}", f"Each row is A = {order}, {robot.convention} convention"]
    for name in ("base", "flange", "tool"):
        transform = getattr(robot, name)
        if not np.array_equal(transform, np.eye(4)):
            notes.append(f"The fixed transform {name} is {transform.tolist()}")
    if robot.is_coupled:
        notes.append(f"Joint values are q_dh = C q of the readings q, C = {robot.coupling.tolist()}")
    return notes
