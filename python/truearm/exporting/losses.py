"""What an export cannot hold, in words: they stand in the file and on the screen."""

from collections.abc import Sequence
from textwrap import wrap
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.description.robot_data import RobotData
from truearm.doubts.outliers import Outliers
from truearm.errors import list_rows
from truearm.fits.models import CONSTANT
from truearm.fits.parameters import BETA, A, D

ONLY_ROS: Final = (
    "This changes the model that ROS computes with, and with it plans, transforms and visualisation. It does "
    "not change the controller, which keeps its own kinematics: a Cartesian target sent to it is reached as "
    "before"
)
FORMAT_WORDS: Final = {
    "urdf": "a URDF",
    "ur-yaml": "this file",
    "dh-toml": "a D-H table",
    "dh-json": "a D-H table",
    "dh-csv": "a D-H table",
}

FELT_M: Final = 1e-9
"""A beta that moves the tool by less at the arm's full reach is rounding, and nothing is lost with it."""
LINK_ORDER: Final = {
    "standard": "Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)",
    "modified": "Rx(alpha) Tx(a) Ry(beta) Rz(theta) Tz(d)",
}


def field_is_lost(calibration: Calibration, export_format: str) -> list[str]:
    """That the field is not in a file of constants, with the held-out errors that this makes."""
    if calibration.model_name == CONSTANT:
        return []
    validation = calibration.validation
    errors = validation.holdout
    whole = (
        "Programs rewritten by truearm compensate have all of it"
        if calibration.scheme is None
        else f"truearm compensate does not know the scheme {calibration.model_name}; calibrate with "
        "--model variable for programs that have all of it"
    )
    constant, variable = (errors[name].position.mean for name in (CONSTANT, calibration.model_name))
    return [
        f"The parameters of this calibration vary over the workspace; {FORMAT_WORDS[export_format]} holds "
        f"the constant part alone. On {validation.n_holdout} {validation.judged} rows the constant part "
        f"left {constant:.3f} mm in the mean, the whole calibration {variable:.3f} mm"
        f"{_without_outliers(calibration)}. {whole}"
    ]


def _without_outliers(calibration: Calibration) -> str:
    outliers = Outliers.of(calibration)
    if not outliers.means_mm:
        return ""
    constant, variable = (outliers.means_mm[name] for name in (CONSTANT, calibration.model_name))
    return f"; without the outliers among them, {outliers.judged}, {constant:.3f} and {variable:.3f} mm"


def beta_is_lost(robot: RobotData) -> list[str]:
    """That software with four parameters a link leaves Hayati's beta out."""
    reach_m = np.abs(robot.table[:, [A, D]]).sum()
    rows = np.flatnonzero(np.abs(robot.table[:, BETA]) * reach_m > FELT_M) + 1
    if not len(rows):
        return []
    verb = "has" if len(rows) == 1 else "have"
    largest = np.degrees(np.abs(robot.table[:, BETA]).max())
    return [
        f"{list_rows(rows.tolist(), 'link').capitalize()} of the table {verb} beta, Hayati's turn about y "
        f"between nearly parallel axes, up to {largest:.4f} deg. Software with four parameters a link has no "
        "place for it: it must not be left out there"
    ]


def coupling_is_lost(robot: RobotData) -> list[str]:
    """That the joints of a URDF are D-H joints, not readings, where readings are coupled."""
    if is_directed(robot):
        return []
    return [
        f"The readings of this arm are coupled: its joints here are Denavit-Hartenberg joints, q_dh = C q "
        f"with C = {robot.coupling.tolist()}, and their limits, which are of readings, are left out"
    ]


def is_directed(robot: RobotData) -> bool:
    """Whether each joint value is one reading, either way round."""
    diagonal = np.diag(robot.coupling)
    return bool(np.array_equal(robot.coupling, np.diag(diagonal)) and set(np.abs(diagonal)) == {1.0})


def as_comments(notes: Sequence[str], mark: str = "#") -> str:
    """Notes as lines of comments, each with its full stop, in lines of at most 100 columns."""
    lines = [line for note in notes for line in wrap(f"{note.rstrip('.')}.", 98 - len(mark))]
    return "".join(f"{mark} {line}\n" for line in lines)
