"""What `truearm frame` finds frames from, and how it shows them."""

from pathlib import Path
from typing import Any

import numpy as np

from truearm.calibration import Calibration
from truearm.cli.console import print_table, say, say_wrapped
from truearm.errors import InputError, UsageError
from truearm.framing import IdentifiedFrame, former_entry, tip_covariance
from truearm.measurements import Measurements
from truearm.rotations import matrix_from_quaternion, quaternion_from_euler, quaternion_from_matrix
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si


def stated_orientation(stated: str | None, data: Measurements, output: Path, name: str) -> Floats | None:
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


def touching_tool(stated: str | None, calibration: Calibration, output: Path) -> tuple[Floats, Floats | None]:
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


def print_frame(found: IdentifiedFrame, name: str, calibration: Calibration, output: Path) -> None:
    """Print where the frame is, how well that is known, and how well the touches agree."""
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
