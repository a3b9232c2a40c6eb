"""Targets, joints and set-ups that stand otherwise from some row on, told with row, size and way out."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.defaults import NO_DRIFT
from truearm.doubts.at_once import (
    BESIDE,
    FRAME,
    JOINT,
    JOINT_MOVED,
    SCALE,
    SCALE_DIFFERS,
    SETUP_TURNED,
    TARGET,
    TARGET_SLIPPED,
    Left,
    Shape,
    Step,
    likeliest_step,
)
from truearm.doubts.row_order import FOLLOWED, poses_change, poses_of, share_explained
from truearm.doubts.whitened import Whitened
from truearm.errors import Notice
from truearm.fits.fitted_rows import ODDS_OF_CHANCE, FittedRows
from truearm.fits.identified import FRAME_UNKNOWNS
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.types import AXES, Floats, Mask, Rows
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

HOTTEST_K: Final = 50.0
"""Nobody measures an arm that is warmer or colder by more."""
KINDS: Final = {TARGET: TARGET_SLIPPED, JOINT: JOINT_MOVED, FRAME: SETUP_TURNED, SCALE: SCALE_DIFFERS}
OF_ONE_ARM: Final = (JOINT_MOVED, SCALE_DIFFERS)
"""Kinds of what one set-up shows against others, and these against it."""
MOSTLY: Final = 0.5
"""Part of the squares that a step explains where a calibration does not help, or rows are outliers, for it to
be the reason."""
DIGITS: Final = 2
OWN_GROUP: Final = (
    "Give the rows behind a name of their own in a column `group`: each part then has a frame and a target "
    "of its own."
)
PER_KELVIN: Final = {"aluminium": 23e-6, "steel": 12e-6}
"""Part of their length by which links of a material grow."""
PARTS_PER_MILLION: Final = 1e6


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of n values of one set-up by what may stand otherwise.

    Attributes:
        setup: By the unknowns of the set-up, its frame first, if that is not known (n, W).
        joints: By the joint readings (n, N).
        points: Which values are coordinates of points, x, y and z one after the other (n,).
        frame: How many unknowns its frame has.
        targets: Which targets of the rows are fitted, from 0.
        scaled: By a common scale of all lengths (n,), where that is asked.
    """

    setup: Floats
    joints: Floats
    points: Mask
    frame: int
    targets: tuple[int, ...]
    scaled: Floats | None = None

    @property
    def columns(self) -> Floats:
        """All of them (n, p), behind those by a shift of all points."""
        shift = np.zeros((len(self.points), AXES))
        shift[self.points] = np.tile(np.eye(AXES), (self.points.sum() // AXES, 1))
        scaled = [] if self.scaled is None else [self.scaled[:, None]]
        return np.hstack([shift, self.setup, self.joints, *scaled])

    def shapes(self) -> Iterator[Shape]:
        """What of it may: the frame's turn, all targets or one of them, one joint or all, the scale."""
        if self.frame == FRAME_UNKNOWNS:
            yield Shape(FRAME, (), tuple(range(2 * AXES, AXES + self.frame)))
        yield from self._of_targets()
        end = AXES + self.setup.shape[1]
        for joint in range(self.joints.shape[1]):
            yield Shape(JOINT, (joint,), (end + joint,))
        behind = end + self.joints.shape[1]
        yield Shape(JOINT, tuple(range(self.joints.shape[1])), tuple(range(end, behind)))
        if self.scaled is not None:
            yield Shape(SCALE, (), (behind,))

    def _of_targets(self) -> Iterator[Shape]:
        """Shifts of the targets that the set-up holds, three columns each, and the turn behind them."""
        told = AXES + np.flatnonzero(self.setup.any(axis=0))
        behind = AXES + self.frame + AXES * np.arange(len(self.targets) + 1)
        own = [tuple(told[(told >= first) & (told < first + AXES)].tolist()) for first in behind]
        shifts = {target: columns for target, columns in zip(self.targets, own[:-1], strict=True) if columns}
        every, turn = tuple(column for columns in shifts.values() for column in columns), own[-1]
        yield Shape(TARGET, tuple(shifts), every)
        if turn:
            yield Shape(TARGET, (), turn)
            yield Shape(TARGET, tuple(shifts), (*every, *turn))
        for target, columns in shifts.items() if len(shifts) > 1 else ():
            yield Shape(TARGET, (target,), columns)

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
        others: Whether there are other set-ups.
    """

    robot: Robot
    data: Measurements
    rows: Rows
    left: Left
    by: Derivatives
    others: bool = False

    def step(self) -> Step | None:
        """What stands otherwise from some visit on; None where poses tell the order, or change there too."""
        poses = poses_of(self.robot, self.data.readings[self.rows])
        if share_explained(poses, np.arange(float(len(poses)))) > FOLLOWED:
            return None
        shapes, columns = list(self.by.shapes()), self.by.columns
        found = likeliest_step(self.left, columns, shapes, range(AXES), others=self.others)
        if found is None or poses_change(poses, np.arange(float(len(poses))), (found.place - 1, found.place)):
            return None
        return found

    @property
    def group(self) -> str:
        """Its name."""
        return str(self.data.group[self.rows[0]])

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
        gain: Logarithm of its evidence over that of none, less that of how much was asked for it.
        group: Name of its set-up.
        behind: Place of the first row behind it; None where the whole set-up differs from others.
    """

    notice: Notice
    chance: float
    share: float
    gain: float
    group: str
    behind: int | None


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
    return [] if seen is None else [slip for slip in _slips(found, fitted, seen) if slip.share > MOSTLY]


def _slips(found: Calibration, fitted: FittedRows, seen: Whitened) -> list[Slip]:
    if found.variable is None or found.options.drift == NO_DRIFT:
        return []
    return slips_of(list(sessions_of(found, fitted, seen)))


def slips_of(sessions: Sequence[Session]) -> list[Slip]:
    """The step of each session that has one, in words, the most evident first.

    Joints and lengths are those of one arm: what one set-up shows of them, others show as well.
    """
    found = [(step, session) for session in sessions if (step := session.step()) is not None]
    told = list[Slip]()
    for step, session in sorted(found, key=lambda pair: -pair[0].gain):
        chance, kind = step.chance * len(sessions), KINDS[step.shape.what]
        if chance < ODDS_OF_CHANCE and not (told and kind in OF_ONE_ARM):
            behind = int(session.rows[step.place]) if step.place else None
            gain = step.gain - float(np.log(step.tries * len(sessions)))
            notice = Notice(kind, _words(session, step))
            told.append(Slip(notice, chance, step.share, gain, session.group, behind))
    return told


def sessions_of(found: Calibration, fitted: FittedRows, seen: Whitened) -> Iterator[Session]:
    """Those of a calibration's set-ups."""
    group, width = fitted.data.group[seen.rows], seen.left.shape[1]
    pull, alone = seen.root.T @ seen.left.ravel(), seen.precision
    metric = alone - seen.root.T @ seen.taken @ seen.root
    # What is left open of frames and targets, as heights on a SCARA, turns small tilts into a scale.
    of_setups = found.identifiability.total_rank - found.identifiability.rank
    is_open = of_setups < len(found.groups) * seen.setup.shape[-1]
    for name in found.groups:
        own, values = group == name, np.flatnonzero(np.repeat(group == name, width))
        count = len(values)
        if count < 2 * BESIDE * width:
            continue
        both, visit = np.ix_(values, values), np.arange(count) // width
        left = Left(pull[values], metric[both], alone[both], visit, seen.square, seen.freedom)
        by_readings = seen.joints[own] @ found.robot.coupling
        setup, joints = (each.reshape(count, -1) for each in (seen.setup[own], by_readings))
        points = np.ones(count, dtype=np.bool_)
        frame, targets = found.arm.frame_unknowns, found.selection.targets
        scaled = None if is_open else seen.scaled[own].ravel()
        by = Derivatives(setup, joints, points, frame, targets, scaled)
        yield Session(found.robot, fitted.data, seen.rows[own], left, by, len(found.groups) > 1)


def _words(session: Session, step: Step) -> str:
    """What stands otherwise, from where on, by how much, and what to do."""
    where = f"Between {session.row(step.place - 1)} and {session.row(step.place)}"
    if step.place == 0:
        where = f"In {session.group}, against the other set-ups,"
    if step.shape.what == TARGET:
        return f"{where} {_of_target(session.by, step)}. {OWN_GROUP}"
    far = length_mm(session.by.way_mm(step), DIGITS)
    if step.shape.what == FRAME:
        return (
            f"{where} the measuring device, or the arm's base, turned by {mrad(step.sizes)} (points by "
            f"{far} on average). {OWN_GROUP}"
        )
    if step.shape.what == SCALE:
        return f"{where} {_of_scale(step, far)}"
    what, way_out = _of_joints(session, step)
    return f"{where} {what}: points by {far} on average. {way_out}"


def _of_target(by: Derivatives, step: Step) -> str:
    """Which targets slipped, or turned, and how far."""
    numbers = step.shape.numbers
    shifts, turn = np.split(step.sizes, [AXES * len(numbers)])
    if not numbers:
        return f"the target turned on the tool by {mrad(turn)}, about itself"
    by_mm = MM_PER_METRE * shifts.reshape(-1, AXES)
    how = f"by {' and '.join(length_mm(float(each), DIGITS) for each in np.linalg.norm(by_mm, axis=1))}"
    if len(numbers) > 1:
        return f"the targets slipped on the tool, or were put elsewhere on it, {how}"
    axes = ", ".join(f"{name} {value:+.3f}" for name, value in zip("xyz", by_mm[0], strict=True))
    what = "the target" if len(by.targets) == 1 else f"target {numbers[0] + 1}"
    turned = f", and turned by {mrad(turn)}" if len(turn) else ""
    return (
        f"{what} slipped on the tool, or was put elsewhere on it, {how} (along the flange's axes {axes} mm)"
        f"{turned}"
    )


def mrad(turn: Floats) -> str:
    """The size of a turn (3,), rad, in words."""
    return f"{_rounded(MRAD_PER_RAD * float(np.linalg.norm(turn)))} mrad"


def _rounded(number: float) -> str:
    """A number with its leading digits alone, in words."""
    return f"{float(f'{number:.{DIGITS}g}'):g}"


def _of_joints(session: Session, step: Step) -> tuple[str, str]:
    """Which joints moved, and what to do: what frame or target of a set-up take over needs no more."""
    numbers, by, joints = step.shape.numbers, session.by, session.robot.joints
    sizes = [_moved_by(joints[joint], size) for joint, size in zip(numbers, step.sizes, strict=True)]
    moved = f"joint {numbers[0] + 1} moved by {sizes[0]} against its reading"
    why = "as where one slips or is mastered anew"
    if len(numbers) > 1:
        each = ", ".join(f"{joint + 1} by {size}" for joint, size in zip(numbers, sizes, strict=True))
        moved = f"joints moved against their readings ({each})"
        why = "as where they are mastered anew or another load is carried (note it in a column payload_kg)"
    if numbers == (0,) and by.frame:
        return f"{moved}, or the measuring device about the same axis", OWN_GROUP
    if numbers == (len(joints) - 1,) and len(by.targets) == 1:
        return f"{moved}, or the tool about the same axis", OWN_GROUP
    return f"{moved}, {why}", _one_part(session, step)


def _of_scale(step: Step, far: str) -> str:
    """How much longer or shorter all lengths are, of what, and what to do."""
    size = abs(float(step.sizes[0]))
    longer, warmer = ("longer", "warmer") if step.sizes[0] > 0.0 else ("shorter", "colder")
    kelvin = {material: size / growth for material, growth in PER_KELVIN.items()}
    heat = "."
    if min(kelvin.values()) < HOTTEST_K:
        how = " or ".join(f"{_rounded(each)} K ({material})" for material, each in kelvin.items())
        heat = (
            f", or an arm that is {warmer} by {how}: note its temperature in a column and calibrate with "
            "--features, or from rows of one temperature alone."
        )
    return (
        f"all lengths are {longer} by {_rounded(PARTS_PER_MILLION * size)} ppm: points by {far} on average "
        "about their middle. That is an instrument of another scale (measure one known distance with each, "
        f"and put the coordinates of that which is off right){heat}"
    )


def _one_part(session: Session, step: Step) -> str:
    """What to do with rows of which some are of an arm that stands otherwise."""
    those = "those behind" if step.place else f"those of {session.group}"
    return (
        f"Rows of one arm are needed: calibrate from {those} alone, or, where these are few, from the "
        "others, and bring that up to date with them (truearm update)."
    )


def _moved_by(joint: str, size: float) -> str:
    """How far a joint moved, in words."""
    return f"{MM_PER_METRE * size:+.3f} mm" if joint == "prismatic" else f"{np.degrees(size):+.4f} deg"
