"""Readings that would fit the nominal arm in another convention: directions, zeros, signs, the frame."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, product
from typing import Final

import numpy as np

from truearm._core import Chain
from truearm.description.robot_data import Convention as RowConvention
from truearm.doubts.column_units import ColumnUnit, column_units
from truearm.doubts.nominal_misfit import FEWEST_ROWS, NominalArm, Seen
from truearm.doubts.of_results import FITS_OTHERWISE
from truearm.errors import Notice, count_of
from truearm.fits.fitting import Task
from truearm.fits.parameters import ALPHA, KINDS, THETA, A, D
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rows.evenly import some_rows
from truearm.types import Floats
from truearm.units import MM_PER_METRE

BETTER: Final = 5.0
"""Times that the right convention brings the nominal arm closer: one that is wrong leaves centimetres."""
NEAR_M: Final = 0.02
"""A nominal arm that is read rightly is nearer."""
AS_WELL: Final = 1.5
EXACT_M: Final = 1e-4
"""Conventions fit as well whose misfits are within this factor of the least, or are none to speak of."""
ALL_OF_JOINTS: Final = 7
"""With as many joints all combinations of them are tried, with more those of SOME_OF_MANY."""
SOME_OF_MANY: Final = 3
MOST_BESIDE: Final = 2
"""Of joints that are turned and of zeros that are elsewhere so many are tried together."""
QUARTERS: Final = (1, -1, 2)
"""Where another zero may be, in quarter turns."""
QUARTER_DEG: Final = 90.0
SIGNED: Final = 1e-3
"""Parameters that are larger have a sign to be wrong, m or sine of an angle."""
OTHER_ROWS: Final[Mapping[RowConvention, RowConvention]] = {"standard": "modified", "modified": "standard"}
SHOULDER, ELBOW = 1, 2
MIRROR: Final = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Convention:
    """How readings and points may have to be read.

    Attributes:
        turned: Joints, from 0, that the controller counts the other way.
        coupled: How much joint 2's reading turns joint 3; None as the robot file has it.
        mirrored: Whether the device's frame is left-handed.
        zeros: Joints, from 0, whose theta is more by so many quarter turns.
        signs: Links, from 0, with the place of a parameter in their row that has the other sign.
        other_rows: Whether the rows are of the other one of the two Denavit-Hartenberg conventions.
        exchanged: Two joints, from 0, whose readings stand in each other's column.
        unit: The column that stands in another unit than the others, if one does.
    """

    turned: tuple[int, ...] = ()
    coupled: float | None = None
    mirrored: bool = False
    zeros: tuple[tuple[int, int], ...] = ()
    signs: tuple[tuple[int, int], ...] = ()
    other_rows: bool = False
    exchanged: tuple[int, ...] = ()
    unit: ColumnUnit | None = None

    @property
    def changes(self) -> int:
        """In how much it differs from what robot file and measurements say."""
        of_rows = len(self.signs) + self.other_rows + bool(self.exchanged) + (self.unit is not None)
        return len(self.turned) + (self.coupled is not None) + self.mirrored + len(self.zeros) + of_rows

    @property
    def order(self) -> tuple[bool, int, bool, int, int]:
        """The least comes first: a left-handed frame beside other changes last, then few changes."""
        beside = self.mirrored and self.changes > 1
        return beside, self.changes, self.mirrored, len(self.signs), len(self.zeros)

    def robot(self, robot: Robot) -> Robot:
        """A robot with the coupling and the rows of this convention."""
        coupling, table = self._coupling(robot), self._table(robot)
        return replace(robot, coupling=coupling, table=table, convention=self._rows(robot))

    def arm(self, robot: Robot) -> NominalArm:
        """The same up to its flange, without the checks of a robot."""
        table = self._table(robot)
        chain = Chain(self._rows(robot), robot.joints, table, robot.base, robot.flange)
        return NominalArm(chain, table, self._coupling(robot))

    def _coupling(self, robot: Robot) -> Floats:
        """Joint values from readings (N, N), with the directions of this convention."""
        coupling = robot.coupling.copy()
        if self.coupled is not None:
            coupling[ELBOW, SHOULDER] = self.coupled
        coupling[:, self.turned] *= -1.0
        return coupling

    def _table(self, robot: Robot) -> Floats:
        """The rows (N, 5), with the zeros and signs of this convention."""
        table = robot.table.copy()
        for joint, quarters in self.zeros:
            table[joint, THETA] = np.deg2rad(_theta_deg(robot, joint, quarters))
        for link, place in self.signs:
            table[link, place] *= -1.0
        return table

    def _rows(self, robot: Robot) -> RowConvention:
        return OTHER_ROWS[robot.convention] if self.other_rows else robot.convention

    def measured(self, seen: Seen) -> Seen:
        """What was measured in the columns and the frame of this convention."""
        if self.exchanged:
            readings = seen.readings.copy()
            readings[:, self.exchanged] = seen.readings[:, self.exchanged[::-1]]
            seen = replace(seen, readings=readings)
        if self.unit is not None:
            seen = self.unit.measured(seen)
        return replace(seen, points=seen.points * MIRROR) if self.mirrored else seen

    def words(self, robot: Robot) -> str:
        """What is otherwise, and what the robot file then says."""
        own, parts = self.robot(robot), list[str]()
        signs = np.where(np.diag(own.coupling) < 0.0, -1.0, 1.0)
        parts += [
            f"joint {joint + 1} is counted the other way (direction = {signs[joint]:.0f} in its link)"
            for joint in self.turned
        ]
        if self.coupled is not None:
            row = ", ".join(f"{entry + 0.0:g}" for entry in own.coupling[ELBOW] * signs)
            against = "the horizontal" if self.coupled else "link 2"
            parts.append(f"joint 3 is counted against {against} (row 3 of [coupling] is [{row}])")
        parts += [
            f"the zero of joint {joint + 1} is elsewhere "
            f"(theta = {_theta_deg(robot, joint, quarters):.7g} deg in its link, "
            f"and not {_theta_deg(robot, joint, 0):.7g})"
            for joint, quarters in self.zeros
        ]
        parts += [
            f"{KINDS[place]} of link {link + 1} has the other sign ({_value(own, link, place)}, and not "
            f"{_value(robot, link, place).rpartition(' = ')[2]})"
            for link, place in self.signs
        ]
        if self.other_rows:
            parts.append(f'its rows are of the other convention (convention = "{own.convention}")')
        if self.exchanged:
            one, other = (joint + 1 for joint in self.exchanged)
            parts.append(f"the columns of joints {one} and {other} are exchanged")
        if self.unit is not None:
            parts.append(self.unit.words)
        if self.mirrored:
            parts.append("the device's frame is left-handed (one axis reversed, or two exchanged)")
        return ", and ".join(parts)


def _theta_deg(robot: Robot, joint: int, quarters: int) -> float:
    """The theta of a joint with so many quarter turns more, above -180 and up to 180 deg."""
    more = np.rad2deg(robot.table[joint, THETA]) + QUARTER_DEG * quarters
    return float(180.0 - (180.0 - np.round(more, 9)) % 360.0)


def _value(robot: Robot, link: int, place: int) -> str:
    """A parameter with its value, as in "a = -35 mm"."""
    value = float(robot.table[link, place])
    shown = f"{value * MM_PER_METRE:.7g} mm" if place in (D, A) else f"{np.rad2deg(value):.7g} deg"
    return f"{KINDS[place]} = {shown}"


def fits_otherwise(task: Task, data: Measurements) -> list[Notice]:
    """A notice where the nominal arm fits measured points far better in another convention.

    Of an arm that is its own mirror image, as most with a spherical wrist are, a left-handed frame with some
    joints counted the other way is the same as a right-handed one with others: no measurement tells them
    apart. Of those that fit as well one with a right-handed frame is named, of these the one with the fewest
    changes, and that there are others is said. A left-handed frame alone, with all joints as the robot file
    has them, is one change: it is named where no single change of a right-handed frame fits.

    Args:
        task: What was fitted to the measurements.
        data: The measurements.
    """
    if task.selection.distances:
        return []
    target, robot = data.most_held(task.selection.targets), task.arm.robot
    rows = _some_rows(task, data, target)
    if len(rows) < FEWEST_ROWS:
        return []

    seen = Seen.of(rows, target)

    def misfit(convention: Convention) -> float:
        return convention.arm(robot).misfit_m(convention.measured(seen), task.threads)

    before = misfit(Convention())
    found = {convention: misfit(convention) for convention in conventions_of(robot) if convention.changes}
    best = min(found.values())
    if best >= min(before / BETTER, NEAR_M):
        return []
    fitting = [convention for convention, off in found.items() if off <= max(AS_WELL * best, EXACT_M)]
    fitting = [convention for convention in fitting if not _needs_less(convention, fitting)]
    named, *others = sorted(fitting, key=lambda convention: (convention.order, found[convention]))
    off, instead = (length_mm(value * MM_PER_METRE, 3) for value in (found[named], before))
    instead = f" in place of {instead}" if np.isfinite(before) else ""
    text = (
        f"The measurements fit {robot.name}, with a median of {off}{instead} before any "
        f"calibration, if {named.words(robot)}. Put that right in a robot file of the arm or "
        f"in the measurements, and calibrate again.{_words_of_others(robot, others)}"
    )
    return [Notice(FITS_OTHERWISE, text)]


def _needs_less(convention: Convention, fitting: Sequence[Convention]) -> bool:
    """Whether a part of its signs alone fits: frame and target take over those of first and last link."""
    return any(
        set(other.signs) < set(convention.signs) and replace(other, signs=()) == replace(convention, signs=())
        for other in fitting
    )


def _words_of_others(robot: Robot, others: list[Convention]) -> str:
    """That, and what, fits as well as what was named: the first, and the first left-handed frame."""
    if not others:
        return ""
    named = [others[0], *[other for other in others[1:] if other.mirrored][: not others[0].mirrored]]
    ways = ", or if ".join(other.words(robot) for other in named)
    more = len(others) - len(named)
    rest = f", or in {'another way' if more == 1 else count_of(more, 'other way')}" if more else ""
    return (
        f" They fit as well if {ways}{rest}: measurements alone do not tell which is true. "
        "Jog each joint that is named, and look which way it turns and where it is at zero."
    )


def _some_rows(task: Task, data: Measurements, target: int) -> Measurements:
    """Some rows of the set-up with the most, with points that were measured."""
    seen = data.seen(target)
    groups = [np.flatnonzero(seen & (data.group == group)) for group in task.groups]
    return data.select(some_rows(max(groups, key=len)))


def conventions_of(robot: Robot) -> Iterator[Convention]:
    """All conventions of a robot, of zeros and of joints that are turned few together."""
    count = robot.joint_count
    most = count if count <= ALL_OF_JOINTS else SOME_OF_MANY
    turned = list(chain.from_iterable(combinations(range(count), turning) for turning in range(most + 1)))
    coupled: list[float | None] = [None]
    if robot.joints[:3] == ("revolute",) * 3:
        known = float(robot.coupling[ELBOW, SHOULDER])
        coupled += [value for value in (0.0, 1.0, -1.0) if value != known]
    yield from (Convention(*parts) for parts in product(turned, coupled, (False, True)))
    yield from _of_rows(robot)
    for zeros in _zeros(robot, most):
        beside = MOST_BESIDE if len(zeros) <= MOST_BESIDE else 0
        yield from (Convention(some, zeros=zeros) for some in turned if len(some) <= beside)


def _of_rows(robot: Robot) -> Iterator[Convention]:
    """What may be written otherwise in the rows of the table, or in the columns of the readings."""
    yield Convention(other_rows=True)
    signed = [
        (link, place)
        for link, row in enumerate(robot.table)
        for place in (D, A, ALPHA)
        if abs(np.sin(row[place]) if place == ALPHA else row[place]) > SIGNED
    ]
    for count in range(1, MOST_BESIDE + 1):
        yield from (Convention(signs=signs) for signs in combinations(signed, count))
    yield from (Convention(unit=unit) for unit in column_units(robot))
    for joints in combinations(range(robot.joint_count), 2):
        if robot.joints[joints[0]] == robot.joints[joints[1]]:
            yield Convention(exchanged=joints)


def _zeros(robot: Robot, most: int) -> Iterator[tuple[tuple[int, int], ...]]:
    """Zeros that may be elsewhere, of one joint or more, `most` at the most.

    Not of the first and the last joint: the frame and the target, which are fitted, take these over.
    """
    inner = [joint for joint in range(1, robot.joint_count - 1) if robot.joints[joint] == "revolute"]
    for count in range(1, min(len(inner), most) + 1):
        for joints, quarters in product(combinations(inner, count), product(QUARTERS, repeat=count)):
            yield tuple(zip(joints, quarters, strict=True))
