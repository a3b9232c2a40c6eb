"""`truearm export`: a calibration for other software."""

from pathlib import Path
from typing import Annotated, Final

import typer

from truearm.cli.arguments import AsJson, CalibFile, features_of
from truearm.cli.console import print_json, say, say_wrapped, suggest
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.errors import count_of, typed
from truearm.files import check_output

READ_AS_ROBOT: Final = ("dh-toml", "urdf")


def command(
    calibration: CalibFile,
    to: Annotated[
        str,
        typer.Option(
            "--to", metavar="urdf|ur-yaml|dh-toml|dh-json|dh-csv|field-csv", help="What is written."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="The file to write.")],
    urdf: Annotated[
        str | None,
        typer.Option(
            metavar="FILE[#TIP]", help="urdf: correct this URDF's chain and keep the rest of it, meshes too."
        ),
    ] = None,
    kinematics_hash: Annotated[
        str | None,
        typer.Option(
            "--hash",
            metavar="calib_N",
            help="ur-yaml: the arm's own hash, so that the driver takes the file.",
        ),
    ] = None,
    grid: Annotated[
        str | None,
        typer.Option(
            metavar="q1=-90:90:7,q4=30",
            help="field-csv: from, to and count of a joint, or its one reading, deg or mm.  "
            "[default: five of each joint]",
        ),
    ] = None,
    feature: Annotated[
        list[str] | None, typer.Option(metavar="NAME=NUMBER", help="field-csv: a feature to sample at.")
    ] = None,
    std: Annotated[bool, typer.Option("--std", help="field-csv: add standard deviations.")] = False,
    as_json: AsJson = False,
) -> None:
    """Write a calibration for other software.

    urdf, ur-yaml and the D-H tables hold the constant part; each is read again and its forward kinematics
    are compared before it is written. field-csv samples the whole calibration on a grid of readings. What a
    file cannot hold is said in it and here.

    Examples:
      truearm export arm.calib --to dh-toml -o arm.toml
      truearm export arm.calib --to urdf --urdf ur10.urdf#tool0 -o new.urdf
      truearm export arm.calib --to field-csv --grid q2=-90:0:19 -o field.csv
    """
    from truearm.calibration import Calibration
    from truearm.exporting import ExportOptions, export

    check_output(output, calibration, None if urdf is None else str(urdf))
    options = ExportOptions(
        urdf=urdf,
        kinematics_hash=kinematics_hash,
        grid=grid,
        features=features_of(feature) or None,
        with_std=std,
    )
    with ends_promptly(), told_stages()("exporting"):
        made = export(Calibration.load(calibration), to, output, options)
    if as_json:
        found = {"format": made.format, "file": str(output), "notes": list(made.notes)}
        print_json(found | {"difference_m": made.difference_m, "rows": made.rows})
        return
    for note in made.notes:
        say_wrapped(f"{note.rstrip('.')}.")
        say()
    if made.difference_m is not None:
        say(f"Read again, its forward kinematics are ours within {made.difference_m:.0e} m.")
    if made.rows is not None:
        say(f"{count_of(made.rows, 'sample')}.")
    say(f"Written: {output}")
    if to in READ_AS_ROBOT:
        read = f"{output}#{made.chain}" if made.chain else output
        suggest(f"truearm robots {typed(read)}")
