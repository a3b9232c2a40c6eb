"""`truearm frame`: a tool or a work object taught again through the calibrated arm."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.cli.console import print_json, print_table, say, say_wrapped, warn
from truearm.errors import InputError, UsageError
from truearm.framing import (
    IdentifiedFrame,
    find_object,
    find_tool,
    former_entry,
    tip_covariance,
    write_frame,
)
from truearm.measurements import Measurements
from truearm.rotations import matrix_from_quaternion, quaternion_from_euler, quaternion_from_matrix
from truearm.units import MM_PER_METRE, to_si

Floats = NDArray[np.float64]


def command(
    calibration: Annotated[
        Path, typer.Argument(metavar="CALIB", help="A file that truearm calibrate wrote.")
    ],
    touches: Annotated[Path, typer.Argument(metavar="TOUCHES", help="CSV with a row a touch.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FRAMES", help="Frames file; other frames in it stay.")
    ],
    tool: Annotated[str | None, typer.Option(metavar="NAME", help="Find this tool.")] = None,
    work_object: Annotated[
        str | None, typer.Option("--object", metavar="NAME", help="Find this work object.")
    ] = None,
    with_tool: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|X,Y,Z",
            help="--object: the tool that touched, of FRAMES, or its tip in mm.  [default: the robot file's]",
        ),
    ] = None,
    orientation: Annotated[
        str | None,
        typer.Option(
            metavar="Z,Y,X",
            help="--tool: how it is turned, deg about z, the new y, the new x.  [default: as FRAMES says]",
        ),
    ] = None,
    length_unit: Annotated[
        str | None, typer.Option(metavar="mm|m", help="Unit of columns that name none.")
    ] = None,
    angle_unit: Annotated[
        str | None, typer.Option(metavar="deg|rad", help="Unit of joint columns that name none.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")] = False,
) -> None:
    """Teach a tool or a work object again, through the calibrated arm.

    A tool: joint readings at four or more touches of one fixed point with its tip, from different sides.
    Columns q1, q2, ... and, if several points were touched, a name in a column "group". With columns x, y, z
    (and qw to qz) they are the tool's positions or poses, measured by a device that stands anywhere.

    A work object: joint readings at touches of three or more of its points, with their true places
    x, y, z in the object's own frame.

    Example: truearm frame arm.calib touches.csv --tool tGripper --orientation 0,0,0 -o frames.toml
    """
    kind, name = _asked(tool, work_object)
    known = Calibration.load(calibration)
    data = Measurements.read_touches(
        touches, length_unit=length_unit, angle_unit=angle_unit, joints=known.robot.joints
    )
    if kind == "tool":
        if with_tool is not None:
            raise UsageError("--with-tool is given with --tool", rule="It belongs to --object")
        found = find_tool(
            known, data, orientation=_orientation(orientation, data, output, name), points=data.group.tolist()
        )
    else:
        if orientation is not None:
            raise UsageError("--orientation is given with --object", rule="It belongs to --tool")
        found = find_object(known, data, *_touching_tool(with_tool, known, output))
    notices = [*data.notices, *found.notices, *write_frame(output, name, found, known.data_hash)]
    warn(notices)
    if as_json:
        print_json({"name": name, "file": str(output), **found.to_dict()})
        return
    _print(found, name, known, output)


def _asked(tool: str | None, work_object: str | None) -> tuple[str, str]:
    if (tool is None) == (work_object is None):
        raise UsageError("give --tool NAME or --object NAME", rule="One frame is found at a time")
    return ("tool", tool) if tool is not None else ("object", str(work_object))


def _orientation(stated: str | None, data: Measurements, output: Path, name: str) -> Floats | None:
    """Orientation of the tool: as stated, else as the frames file has it; None where it was measured."""
    if stated is not None:
        angles = to_si(np.array([_three(stated, "--orientation", "Z,Y,X in deg")]), "deg")
        return matrix_from_quaternion(quaternion_from_euler(angles, "ZYX")[0])
    if data.orientations is not None:
        return None
    former = former_entry(output, "tool", name)
    if former is None:
        raise UsageError(
            "touched or measured points do not tell how the tool is turned",
            rule=f'{output} has no tool "{name}" to take it from',
            way_out="Give --orientation Z,Y,X; 0,0,0 for a tool that is turned like the flange",
        )
    entry, unit = former
    return entry.transform(unit)[:3, :3]


def _touching_tool(
    stated: str | None, calibration: Calibration, output: Path
) -> tuple[Floats, Floats | None]:
    """flange_from_tool (4, 4), and the covariance of its tip if that is known."""
    if stated is None:
        return calibration.robot.tool, None
    former = former_entry(output, "tool", stated)
    if former is not None:
        entry, unit = former
        return entry.transform(unit), tip_covariance(entry)
    tool = np.eye(4)
    tool[:3, 3] = (
        np.array(_three(stated, "--with-tool", f"a tool of {output}, or X,Y,Z in mm")) / MM_PER_METRE
    )
    return tool, None


def _three(text: str, option: str, rule: str) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3 or not np.isfinite(values).all():
        raise InputError(f'"{text}" cannot be read', where=option, rule=f"It must be {rule}")
    return values


def _print(found: IdentifiedFrame, name: str, calibration: Calibration, output: Path) -> None:
    say_wrapped(f'{found.kind.capitalize()} "{name}" of {calibration.robot.name}, from {found.how}.')
    print_table(["", "x", "y", "z"], _rows(found))
    w, x, y, z = quaternion_from_matrix(found.transform[:3, :3])
    say(f"Quaternion w x y z: {w:.6f} {x:.6f} {y:.6f} {z:.6f}")
    worst = int(found.distances_mm.argmax())
    rms = float(np.sqrt(np.square(found.distances_mm).mean()))
    say(f"Residuals: {rms:.3f} mm RMS, {found.distances_mm[worst]:.3f} mm at most (row {found.rows[worst]}).")
    say(f"Written: {output}")


def _rows(found: IdentifiedFrame) -> list[list[str]]:
    def row(heading: str, values: Any, digits: int = 3) -> list[str]:  # noqa: ANN401
        return [heading, *(f"{value:.{digits}f}" for value in values)]

    rows = [
        row("position, mm", found.transform[:3, 3] * MM_PER_METRE),
        row("standard deviation, mm", found.std_mm),
    ]
    return rows + ([row("of its orientation, mrad", found.std_mrad)] if found.std_mrad.any() else [])
