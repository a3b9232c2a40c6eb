"""The paper's cell in small: what `truearm demo` plans, measures, calibrates and compensates."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
import tomli_w

from truearm.calibration import Calibration
from truearm.cell.cell_file import Cell
from truearm.cell.examples import example
from truearm.cell.virtual.world import true_arm, true_frame
from truearm.compensation import Compensator
from truearm.files import parsed
from truearm.measurements import Measurements
from truearm.registration import register
from truearm.rotations import rigid_inverse
from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

EXAMPLE: Final = "rv-m2"
ERRING: Final = {"share": 0.3, "non_geometric": "joint"}
"""How its arm errs beside its geometry: by its joints, as measured arms do."""
PATH_POINTS: Final = 60
NEARER: Final = 0.9


def demonstration_cell(speed: float) -> str:
    """The text of the paper's cell file with an arm that errs by its joints.

    Its virtual clock runs `speed` times as fast as a real one.
    """
    content = parsed(example(EXAMPLE), where=EXAMPLE)
    content["simulate"] |= {"speed": speed, "arm": {"imperfections": ERRING}}
    return tomli_w.dumps(content)


def path_through(readings: Floats) -> Floats:
    """A path (60, N), straight in the joints, past the first, middle and last of readings (n, N).

    It stays nearer to the middle of them all, as compensation needs room before the limits.
    """
    middle = readings.mean(axis=0)
    stops = middle + NEARER * (readings[[0, len(readings) // 2, -1]] - middle)
    places = np.linspace(0.0, len(stops) - 1.0, PATH_POINTS)
    return np.column_stack([np.interp(places, np.arange(len(stops)), column) for column in stops.T])


def path_table(readings: Floats) -> pd.DataFrame:
    """A path of readings (n, N), all revolute, as a table in degrees that `truearm compensate` reads."""
    degrees = readings / RADIANS_PER_DEGREE
    return pd.DataFrame({f"q{j + 1}_deg": column for j, column in enumerate(degrees.T)})


@dataclass(frozen=True, eq=False)
class Followed:
    """A path as the real, virtual arm follows it.

    Attributes:
        before_mm: How far its tool is from where the program means it (n,), uncalibrated, in the frame that
            the nominal arm was registered with.
        after_mm: The same for the compensated path, with frame and tool as the calibration found them.
        corrected: The readings (n, N) of that path.
    """

    before_mm: Floats
    after_mm: Floats
    corrected: Floats


def follow(text: str, calibration: Calibration, data: Measurements, path: Floats) -> Followed:
    """Send a virtual arm along a path, as it is and compensated; refused points are left out.

    Args:
        text: The cell file.
        calibration: Of that cell.
        data: What it comes from.
        path: Readings (n, N).
    """
    cell = Cell.from_toml(text)
    truth, nothing = true_arm(cell), np.empty((0, 3, 3))
    world_from_base = true_frame(cell, truth)
    frame, tool = calibration.model.setup.frames[0], calibration.model.setup.targets[0, 0]
    registered = register(cell.targets_in_base(data.readings), data.targets[:, 0], nothing, nothing, 0.0)
    done = Compensator(calibration).joints(path, tool=tool)
    kept = ~done.refused

    def missed_mm(readings: Floats, meant: Floats, frame: Floats) -> Floats:
        real = world_from_base @ truth.true_pose(readings, tool=cell.flange_from_target)
        apart = (rigid_inverse(frame) @ real)[:, :3, 3] - meant
        return np.asarray(MM_PER_METRE * np.linalg.norm(apart, axis=1))

    flange = cell.arm.flange_chain.pose(cell.arm.joints_from_readings(path[kept]))
    taught = flange[:, :3, :3] @ tool + flange[:, :3, 3]
    return Followed(
        missed_mm(path[kept], cell.targets_in_base(path[kept]), registered),
        missed_mm(done.q[kept], taught, frame),
        done.q[kept],
    )
