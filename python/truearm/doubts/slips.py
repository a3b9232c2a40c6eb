"""Targets, joints and set-ups that stand otherwise from some row on, told with row, size and way out."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from truearm.calibration import Calibration
from truearm.defaults import NO_DRIFT
from truearm.doubts.at_once import AXES, BESIDE, Left, Shape, Step, likeliest_step
from truearm.doubts.row_order import FOLLOWED, poses_change, poses_of, share_explained
from truearm.doubts.whitened import Whitened
from truearm.errors import Notice
from truearm.fits.enough_values import FRAME_UNKNOWNS
from truearm.fits.fitted_rows import OVERWHELMING, FittedRows
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
Mask = NDArray[np.bool_]

TARGET, JOINT, FRAME = "target", "joint", "frame"
TARGET_SLIPPED: Final = "target_slipped"
JOINT_TURNED: Final = "joint_turned"
SETUP_TURNED: Final = "setup_turned"
SLIPPED: Final = {TARGET: TARGET_SLIPPED, JOINT: JOINT_TURNED, FRAME: SETUP_TURNED}
"""Kinds of notices."""
MOSTLY: Final = 0.5
"""Part of the squares that a step explains where a calibration does not help, or rows are outliers, for it to
be the reason."""
DIGITS: Final = 2
OWN_GROUP: Final = (
    "Give the rows behind a name of their own in a column `group`: each part then has a frame and a target of "
    "its own."
)


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of n values of one set-up by what may stand otherwise.

    Attributes:
        setup: By the unknowns of the set-up, its frame first, if that is not known (n, W).
        joints: By the joint values (n, N).
        points: Which values are coordinates of points, x, y and z one after the other (n,).
        frame: How many unknowns its frame has.
        targets: How many targets there are.
    """

    setup: Floats
    joints: Floats
    points: Mask
    frame: int
    targets: int

    @property
    def columns(self) -> Floats:
        """All of them (n, p), behind those by a shift of all points."""
        shift = np.zeros((len(self.points), AXES))
        shift[self.points] = np.tile(np.eye(AXES), (self.points.sum() // AXES, 1))
        return np.hstack([shift, self.setup, self.joints])

    def shapes(self) -> Iterator[Shape]:
        """What of it may: all targets or one of them, one joint or all, the frame's turn."""
        first, end = AXES + self.frame, AXES + self.setup.shape[1]
        if self.frame == FRAME_UNKNOWNS:
            yield Shape(FRAME, (), tuple(range(2 * AXES, first)))
        yield Shape(TARGET, tuple(range(self.targets)), tuple(range(first, end)))
        for target in range(self.targets if self.targets > 1 else 0):
            own = first + AXES * target
            yield Shape(TARGET, (target,), tuple(range(own, own + AXES)))
        for joint in range(self.joints.shape[1]):
            yield Shape(JOINT, (joint,), (end + joint,))
        yield Shape(JOINT, tuple(range(self.joints.shape[1])), tuple(range(end, end + self.joints.shape[1])))

    def way_mm(self, step: Step) -> float:
        """How far a step moves points on average."""
        by = (self.columns[:, list(step.shape.columns)] @ step.sizes)[self.points].reshape(-1, AXES)
        lengths = np.linalg.norm(by, axis=1)
        return float(MM_PER_METRE * lengths[lengths > 0.0].mean())


@dataclass(frozen=True, eq=False)
class Session:
    """Visits of one set-up in the order of measuring, v of them.

    Attributes:
        robot: The arm.
        data: The measurements.
        rows: Place of the first row of each visit among them (v,).
        left: What is left of their values.
        by: Derivatives of these.
    """

    robot: Robot
    data: Measurements
    rows: Rows
    left: Left
    by: Derivatives

    def step(self) -> Step | None:
        """What stands otherwise from some visit on; None where poses tell the order, or change there too."""
        poses = poses_of(self.robot, self.data.readings[self.rows])
        if share_explained(poses, np.arange(float(len(poses)))) > FOLLOWED:
            return None
        found = likeliest_step(self.left, self.by.columns, list(self.by.shapes()), range(AXES))
        if found is None or poses_change(poses, np.arange(len(poses)), (found.place - 1, found.place)):
            return None
        return found

    def row(self, visit: int) -> str:
        """The first row of a visit, in words."""
        return self.data.row_names(np.arange(len(self.data)) == self.rows[visit])


@dataclass(frozen=True)
class Slip:
    """A step that is told.

    Attributes:
        notice: What it is, and what to do.
        chance: How likely chance explains as much.
        share: Part of what is left that it explains.
    """

    notice: Notice
    chance: float
    share: float


def slips(found: Calibration, fitted: FittedRows, seen: Whitened, progress: Floats) -> list[Slip]:
    """What stands otherwise from some row of a set-up on, of a calibration of what varies.

    Where what slipped was taken for outliers, these tell it.

    Args:
        found: The calibration: constants leave too much that poses explain.
        fitted: The rows that it was fitted to.
        seen: What it leaves of them.
        progress: When each was measured, from 0 for the first of its set-up to 1 for the last (n,).
    """
    told = _slips(found, fitted, seen)
    return told if told or len(fitted.outliers()) < BESIDE else main_slips(found, fitted, progress)


def main_slips(found: Calibration, fitted: FittedRows, progress: Floats) -> list[Slip]:
    """Those that explain most of what is left, outliers included; arguments as of `slips`."""
    seen = Whitened.of(found, fitted, progress, outliers=True)
    return [slip for slip in _slips(found, fitted, seen) if slip.share > MOSTLY]


def _slips(found: Calibration, fitted: FittedRows, seen: Whitened) -> list[Slip]:
    if found.variable is None or found.options.drift == NO_DRIFT:
        return []
    return slips_of(list(_sessions(found, fitted, seen)))


def slips_of(sessions: Sequence[Session]) -> list[Slip]:
    """The step of each session that has one, in words."""
    told = []
    for session in sessions:
        step = session.step()
        if step is not None and (chance := step.chance * len(sessions)) < OVERWHELMING:
            notice = Notice(SLIPPED[step.shape.what], _words(session, step))
            told.append(Slip(notice, chance, step.share))
    return told


def _sessions(found: Calibration, fitted: FittedRows, seen: Whitened) -> Iterator[Session]:
    """Those of a calibration's set-ups."""
    group, width = fitted.data.group[seen.rows], seen.left.shape[1]
    frame = 0 if found.arm.world_is_known else FRAME_UNKNOWNS
    pull = np.einsum("iab,ia->ib", seen.root, seen.left)
    taken = seen.taken.reshape(len(group), width, len(group), width)
    for name in found.groups:
        own = np.flatnonzero(group == name)
        if len(own) < 2 * BESIDE:
            continue
        root, count = seen.root[own], len(own) * width
        alone = block_diag(*(root.transpose(0, 2, 1) @ root))
        known = np.einsum("iba,ibjc,jcd->iajd", root, taken[own][:, :, own], root, optimize=True)
        visit = np.repeat(np.arange(len(own)), width)
        left = Left(
            pull[own].ravel(),
            alone - known.reshape(count, count),
            alone,
            visit,
            seen.square,
            seen.freedom,
        )
        setup, joints = (each[own].reshape(count, -1) for each in (seen.setup, seen.joints))
        points = np.ones(count, dtype=np.bool_)
        by = Derivatives(setup, joints, points, frame, len(found.selection.targets))
        yield Session(found.robot, fitted.data, seen.rows[own], left, by)


def _words(session: Session, step: Step) -> str:
    """What stands otherwise, from where on, by how much, and what to do."""
    before, behind = session.row(step.place - 1), session.row(step.place)
    where = f"Between {before} and {behind}"
    if step.shape.what == TARGET:
        return _of_target(session, step, where)
    far = length_mm(session.by.way_mm(step), DIGITS)
    if step.shape.what == FRAME:
        turn = float(MRAD_PER_RAD * np.linalg.norm(step.sizes))
        return (
            f"{where} the measuring device, or the arm's base, turned at once, by {turn:.{DIGITS}g} mrad "
            f"(points by {far} on average). {OWN_GROUP}"
        )
    return _of_joint(session, step, where, far)


def _of_target(session: Session, step: Step, where: str) -> str:
    """Words on targets that slipped."""
    count, numbers = session.by.targets, step.shape.numbers
    by_mm = MM_PER_METRE * step.sizes[: AXES * len(numbers)].reshape(-1, AXES)
    if len(numbers) == 1:
        axes = ", ".join(f"{name} {value:+.3f}" for name, value in zip("xyz", by_mm[0], strict=True))
        how = f"by {length_mm(float(np.linalg.norm(by_mm)), DIGITS)} (along the axes of the flange {axes} mm)"
    else:
        how = f"by {' and '.join(length_mm(float(each), DIGITS) for each in np.linalg.norm(by_mm, axis=1))}"
    what = f"target {numbers[0] + 1}" if len(numbers) < count else "the target" if count == 1 else "the targets"
    verb = "were" if len(numbers) > 1 else "was"
    return (
        f"{where} {what} slipped on the tool, or {verb} put elsewhere on it, {how}. {OWN_GROUP}"
    )


def _of_joint(session: Session, step: Step, where: str, far: str) -> str:
    """Words on joints that turned."""
    sizes = []
    for joint, by in zip(step.shape.numbers, step.sizes, strict=True):
        if session.robot.joints[joint] == "prismatic":
            sizes.append(f"joint {joint + 1} moved by {MM_PER_METRE * by:+.3f} mm")
        else:
            sizes.append(f"joint {joint + 1} turned by {np.degrees(by):+.4f} deg")
    return (
        f"{where} {' and '.join(sizes)} against its reading, as one that slipped or was mastered anew, "
        f"and the target by {far} on average. The rows before are of another arm than those behind: calibrate "
        "from one part alone."
    )
