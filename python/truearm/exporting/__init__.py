"""A calibration for other software: its constant part as URDF or D-H table, its field as samples.

Every file of constants is read again before it is written, and its forward kinematics are compared.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, cast, get_args

from truearm.calibration import Calibration
from truearm.errors import UsageError, count_of, did_you_mean, list_names
from truearm.exporting.constant_part import constant_robot
from truearm.exporting.field_grid import grid_axes, grid_table, grid_text
from truearm.exporting.losses import ONLY_ROS, beta_is_lost, coupling_is_lost, field_is_lost
from truearm.exporting.new_urdf import unstated_limits
from truearm.exporting.tables import csv_text, json_text, toml_text
from truearm.exporting.ur_yaml import yaml_text
from truearm.exporting.urdf_file import urdf_text
from truearm.files import write_whole
from truearm.kinds import check_number, required
from truearm.solving import beyond_notices, feature_values

Format = Literal["urdf", "ur-yaml", "dh-toml", "dh-json", "dh-csv", "field-csv"]
FORMATS: Final = get_args(Format)

__all__ = [
    "FORMATS",
    "ExportOptions",
    "Exported",
    "Format",
    "constant_robot",
    "export",
    "grid_axes",
    "grid_table",
]


@dataclass(frozen=True)
class ExportOptions:
    """What some formats may be told.

    Attributes:
        urdf: For "urdf": the URDF to correct, "FILE.urdf#TIP"; None writes a new one.
        kinematics_hash: For "ur-yaml": the hash that the driver compares with the arm's; None makes one.
        grid: For "field-csv": "q1=-90:90:7,q4=30", deg and mm; None for five readings of each joint
            that moved.
        features: For "field-csv": features of the calibration by name, one number each for all samples.
        with_std: For "field-csv": whether to add standard deviations.

    Raises:
        UsageError: If a feature is not one number.
    """

    urdf: str | None = None
    kinematics_hash: str | None = None
    grid: str | None = None
    features: Mapping[str, float] | None = None
    with_std: bool = False

    def __post_init__(self) -> None:
        for name, value in (self.features or {}).items():
            check_number(value, f'the feature "{name}"')


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes:
        format: Which format.
        text: Content of the file.
        notes: What it cannot hold, and what to mind; the file says so too.
        difference_m: Largest difference between its forward kinematics, read again, and the calibration's
            constant part, m or rad; None for samples.
        rows: Number of samples; None for constants.
        chain: "BASE,TIP", the links between which the arm is, of a URDF that was corrected; else "".
    """

    format: Format
    text: str
    notes: tuple[str, ...]
    difference_m: float | None
    rows: int | None = None
    chain: str = ""

    def __repr__(self) -> str:
        size = count_of(len(self.text.splitlines()), "line")
        return f"<Exported as {self.format}: {size}, {count_of(len(self.notes), 'note')}>"


def export(
    calibration: Calibration, to: str, path: str | Path | None = None, options: ExportOptions | None = None
) -> Exported:
    """Write a calibration for other software.

    Args:
        calibration: What to write.
        to: One of "urdf", "ur-yaml", "dh-toml", "dh-json", "dh-csv" and "field-csv".
        path: Where to; None only makes the text.
        options: What some formats may be told.

    Raises:
        UsageError: If there is no such format, or an option does not fit it.
        InputError: If the arm cannot be held by the format, or a file cannot be read or written.
        WorkError: If the text, read again, is not the calibration; nothing is written then.
    """
    chosen = _format(to)
    calibration = required(calibration, Calibration, "the calibration")
    given = options or ExportOptions()
    _check_options(chosen, given)
    made = _samples(calibration, given) if chosen == "field-csv" else _constants(calibration, chosen, given)
    if path is not None:
        write_whole(Path(path), made.text)
    return made


def _format(name: str) -> Format:
    if name not in FORMATS:
        raise UsageError(
            f'there is no format "{name}"',
            where="--to",
            rule=f"Known are {list_names(FORMATS)}",
            way_out=did_you_mean(name, FORMATS),
        )
    return cast("Format", name)


def _check_options(chosen: Format, options: ExportOptions) -> None:
    belongs = {
        "--urdf": (options.urdf, "urdf"),
        "--hash": (options.kinematics_hash, "ur-yaml"),
        "--grid": (options.grid, "field-csv"),
        "--feature": (options.features, "field-csv"),
        "--std": (options.with_std or None, "field-csv"),
    }
    for option, (value, owner) in belongs.items():
        if value and owner != chosen:
            raise UsageError(f"{option} is given with --to {chosen}", rule=f"It belongs to --to {owner}")


def _samples(calibration: Calibration, options: ExportOptions) -> Exported:
    axes = grid_axes(calibration, options.grid)
    table = grid_table(calibration, axes, features=options.features, with_std=options.with_std)
    note = "Samples of a field are not the field: between them it is not linear"
    guesses = beyond_notices(calibration, feature_values(calibration, options.features))
    beyond = [notice.message for notice in guesses]
    text = grid_text(table, calibration, axes, options.features, notes=beyond)
    return Exported("field-csv", text, (note, *beyond), None, len(table))


def _constants(calibration: Calibration, chosen: Format, options: ExportOptions) -> Exported:
    robot, nominal = constant_robot(calibration), calibration.robot
    notes, chain = field_is_lost(calibration, chosen), ""
    if chosen == "urdf":
        notes += coupling_is_lost(robot) + ([] if options.urdf else unstated_limits(robot))
        text, difference, names = urdf_text(robot, nominal, options.urdf, notes)
        chain = f"{names.base_link},{names.tip_link}" if options.urdf else ""
    elif chosen == "ur-yaml":
        notes = [ONLY_ROS, *notes]
        stated = options.kinematics_hash or _own_hash(calibration)
        text, left, difference = yaml_text(robot, nominal, stated, notes)
        notes += left
    else:
        notes += beta_is_lost(robot)
        makers = {"dh-json": json_text, "dh-csv": csv_text}
        maker = makers.get(chosen)
        text, difference = toml_text(robot, notes) if maker is None else maker(robot, nominal, notes)
    return Exported(chosen, text, tuple(notes), difference, chain=chain)


def _own_hash(calibration: Calibration) -> str:
    """A hash in the driver's form that no arm has: the driver notices that the file is not the arm's own."""
    digest = hashlib.sha256(calibration.data_hash.encode()).digest()
    return f"calib_{int.from_bytes(digest[:8], 'little')}"
