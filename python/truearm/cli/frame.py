"""`truearm frame`: a tool or a work object taught again through the calibrated arm."""

from pathlib import Path
from typing import Annotated

import typer

from truearm.cli.arguments import AngleUnit, AsJson, CalibFile, LengthUnit
from truearm.cli.console import print_json, suggest, warn
from truearm.cli.next_commands import compensate_commands
from truearm.errors import UsageError, typed


def command(
    calibration: CalibFile,
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
    length_unit: LengthUnit = None,
    angle_unit: AngleUnit = None,
    as_json: AsJson = False,
) -> None:
    """Teach a tool or a work object again, through the calibrated arm.

    A tool: joint readings at four or more touches of one fixed point with its tip, from different sides.
    Columns q1, q2, ... and, if several points were touched, a name in a column "group". With columns x, y, z
    (and qw to qz) they are the tool's positions or poses, measured by a device that stands anywhere.

    A work object: joint readings at touches of three or more of its points, with their true places
    x, y, z in the object's own frame. Where FRAMES has the controller's world, $WORLD of KRL or wobj0 of
    RAPID, the object is written in that world, else in the arm's base.

    Examples:
      truearm frame arm.calib touches.csv --tool tGripper -o frames.toml
      truearm frame arm.calib points.csv --object wTable -o frames.toml
    """
    from truearm.calibration import Calibration
    from truearm.cli.frame_finding import print_frame, stated_orientation, touching_tool
    from truearm.files import check_place
    from truearm.framing import find_object, find_tool, write_frame
    from truearm.measurements import Measurements

    kind, name = _asked(tool, work_object)
    check_place(output)
    known = Calibration.load(calibration)
    data = Measurements.read_touches(
        touches, length_unit=length_unit, angle_unit=angle_unit, joints=known.robot.joints
    )
    if kind == "tool":
        if with_tool is not None:
            raise UsageError("--with-tool is given with --tool", rule="It belongs to --object")
        turned = stated_orientation(orientation, data, output, name)
        found = find_tool(known, data, orientation=turned, points=data.group.tolist())
    else:
        if orientation is not None:
            raise UsageError("--orientation is given with --object", rule="It belongs to --tool")
        found = find_object(known, data, *touching_tool(with_tool, known, output))
    notices = [*data.notices, *found.notices, *write_frame(output, name, found, known.data_hash)]
    warn(notices)
    if as_json:
        print_json({"name": name, "file": str(output), **found.to_dict()})
        return
    print_frame(found, name, known, output)
    suggest(*compensate_commands(known, calibration, f" --frames {typed(output)}"))


def _asked(tool: str | None, work_object: str | None) -> tuple[str, str]:
    if (tool is None) == (work_object is None):
        raise UsageError("give --tool NAME or --object NAME", rule="One frame is found at a time")
    return ("tool", tool) if tool is not None else ("object", str(work_object))
