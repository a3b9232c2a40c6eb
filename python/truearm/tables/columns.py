"""Which column of a measurement table means what, and in which unit."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, TypeVar, get_args

from truearm.description.robot_data import Joint
from truearm.errors import InputError, UsageError, did_you_mean, list_names
from truearm.kinds import check_choice, words
from truearm.named_values import JOINT
from truearm.units import ANGLE_UNITS, LENGTH_UNITS

TARGET_COLUMN: Final = re.compile(r"([xyz])([2-9]|[1-9]\d+)?(?:_(m|mm))?")
SIGMA_COLUMN: Final = re.compile(r"sigma(?:_(m|mm))?")
SIGMA_OF_AXIS: Final = re.compile(r"sigma_([xyz])(?:_(m|mm))?")
SIGMA_OF_TURN: Final = re.compile(r"sigma_(rad|mrad|deg)")
SIGMA_COLUMNS: Final = (SIGMA_COLUMN, SIGMA_OF_AXIS, SIGMA_OF_TURN)
SIGMA: Final = "sigma"
"""What only columns of standard deviations begin with."""
SIGMAS: Final = (
    "sigma_mm of each coordinate of a position; sigma_x_mm, sigma_y_mm and sigma_z_mm of each by itself; "
    "sigma_mrad of an orientation; lengths in m as well, angles in rad and deg"
)
DISTANCE_COLUMN: Final = re.compile(r"distance(?:_(m|mm))?")
QUATERNION: Final = ("qw", "qx", "qy", "qz")
WORDS: Final = ("group", "anchor", "pair")
COORDINATES: Final = "xyz"
PURPOSE: Final = "purpose"
VALIDATE: Final = "validate"
"""In the column "purpose": a pose that was planned to judge by, not to fit to."""
REPEAT: Final = "repeat"
"""In the same column: a pose that was planned to be come back to."""
PURPOSES: Final = ("train", VALIDATE, REPEAT)
APPROACH: Final = "approach"
"""Column: from which side all joints came, 1 from lower readings, -1 from higher, 0 from anywhere."""
POSE: Final = "pose"
"""Column: number of the pose in the list that was measured."""
READINGS: Final = "readings"
"""Column: how many readings the measurement is the mean of."""
OF_MEASURING: Final = (PURPOSE, APPROACH, POSE, READINGS)
"""Columns that tell how a row was measured: no program meets such a value."""
ONE_UNIT: Final = "Convert them to one unit, and end all names in it"
OF_A_LENGTH: Final = (
    f"{ONE_UNIT}; if one is of a prismatic joint, end its name in _m or _mm, or say which joints there are "
    "(joints=robot.joints)"
)
K = TypeVar("K")


@dataclass(frozen=True)
class Column:
    """A column of the table, and the unit its numbers are in."""

    name: str
    unit: str


@dataclass
class Layout:
    """The meaning of a table's columns.

    Attributes:
        joints: Columns of joints 1 to N; the unit is "" where neither name nor option states one.
        targets: Three columns for each measured point.
        quaternion: Whether qw, qx, qy, qz are there.
        sigma: Column of the standard deviation of the position.
        sigma_axes: The three columns of that along each axis; none where it is not stated so.
        sigma_turn: Column of the standard deviation of the orientation.
        distance: Column of measured distances.
        words: Which of group, anchor and pair are there.
        others: Names of all further columns.
    """

    joints: list[Column]
    targets: list[tuple[Column, Column, Column]]
    quaternion: bool = False
    sigma: Column | None = None
    distance: Column | None = None
    words: tuple[str, ...] = ()
    others: list[str] = field(default_factory=list)
    sigma_axes: tuple[Column, ...] = ()
    sigma_turn: Column | None = None


@dataclass(frozen=True)
class StatedUnits:
    """What options say of columns that state no unit themselves; None where they say nothing.

    `joints` tells the kinds, so that lengths and angles among the joints can be told apart.
    """

    length: str | None = None
    angle: str | None = None
    joints: Sequence[str] | None = None

    def __post_init__(self) -> None:
        for value, known in ((self.length, LENGTH_UNITS), (self.angle, ANGLE_UNITS)):
            if value is not None and value not in known:
                raise UsageError(f'"{value}" is no unit here', rule=f"Known are {list_names(known)}")
        if self.joints is not None:
            object.__setattr__(self, "joints", words(self.joints, "joints"))
        for kind in self.joints or ():
            check_choice(kind, "joints", get_args(Joint))

    @property
    def joint_count(self) -> int | None:
        """How many joints there are; None where nothing says."""
        return None if self.joints is None else len(self.joints)


def read_layout(names: Sequence[str], stated: StatedUnits, *, where: str, measured: bool = True) -> Layout:
    """Find out what the columns mean; unless `measured`, joints alone will do.

    Raises:
        InputError: If joints or a coordinate are missing, two columns mean the same, or units are mixed.
    """
    finder = _Finder(names, stated, where)
    layout = Layout(joints=finder.joints(), targets=finder.targets())
    layout.quaternion = finder.has_quaternion()
    layout.sigma, layout.sigma_axes = finder.single(SIGMA_COLUMN), finder.sigma_axes()
    layout.sigma_turn = finder.sigma_turn()
    finder.check_sigmas(layout)
    layout.distance = finder.single(DISTANCE_COLUMN)
    layout.words = tuple(word for word in WORDS if word in names)
    if measured and not layout.targets and layout.distance is None:
        raise finder.missing("z" if {"x", "y"} & set(names) else "x", "No position x, y, z and no distance")
    layout.others = [name for name in names if name not in finder.used and name not in layout.words]
    return layout


def read_joint_layout(names: Sequence[str], stated: StatedUnits, *, where: str) -> list[Column]:
    """The joint columns alone, of a table in which nothing need be measured.

    Raises:
        InputError: If joints are missing, two columns mean the same, or units are mixed.
    """
    return _Finder(names, stated, where).joints()


def lookalikes(names: Sequence[str]) -> list[str]:
    """Names that would mean something if case and blanks were written otherwise, such as "Sigma mm"."""
    return [name for name in names if means_something(canonical(name))]


def canonical(name: str) -> str:
    """A name as columns that mean something are written."""
    return name.casefold().replace(" ", "_").replace("-", "_")


class MissingColumnError(InputError):
    """A column that is needed is not there."""


class _Finder:
    def __init__(self, names: Sequence[str], stated: StatedUnits, where: str) -> None:
        self.names, self.stated, self.where = names, stated, where
        self.used: set[str] = set()

    def joints(self) -> list[Column]:
        found: dict[int, Column] = {}
        for name in self.names:
            match = JOINT.fullmatch(name)
            if match:
                self._claim(found, int(match[1]), Column(name, match[2] or ""))
        if not found:
            raise self.missing("q1", "There are no joint columns q1, q2, ...")
        for number in range(1, max(found) + 1):
            if number not in found:
                raise self.missing(
                    f"q{number}", f'Joint column "q{number}" is missing before "q{max(found)}"'
                )
        columns = [found[number] for number in sorted(found)]
        columns = [self._with_stated(index, column) for index, column in enumerate(columns)]
        angles = [column for index, column in enumerate(columns) if not self._is_length(index, column)]
        self._same_unit(angles, OF_A_LENGTH if self.stated.joints is None else ONE_UNIT)
        return columns

    def targets(self) -> list[tuple[Column, Column, Column]]:
        found: dict[tuple[int, str], Column] = {}
        for name in self.names:
            match = TARGET_COLUMN.fullmatch(name)
            if match:
                self._claim(found, (int(match[2] or 1), match[1]), Column(name, match[3] or ""))
        for number, axis in [(n, a) for n in sorted({n for n, _ in found}) for a in COORDINATES]:
            if (number, axis) not in found:
                name = axis if number == 1 else f"{axis}{number}"
                raise self.missing(name, f'Column "{name}" is missing')
        self._same_unit(list(found.values()), ONE_UNIT)
        numbers = sorted({number for number, _ in found})
        if numbers != list(range(1, len(numbers) + 1)):
            raise self.missing("x", f"Target {numbers[-1]} is there without the targets before it")
        columns = {key: self._length(column) for key, column in found.items()}
        return [(columns[n, "x"], columns[n, "y"], columns[n, "z"]) for n in numbers]

    def has_quaternion(self) -> bool:
        present = [name for name in QUATERNION if name in self.names]
        if present and len(present) < 4:
            absent = next(name for name in QUATERNION if name not in present)
            raise self.missing(absent, f'Column "{absent}" of the quaternion is missing')
        self.used.update(present)
        return bool(present)

    def single(self, pattern: re.Pattern[str]) -> Column | None:
        found: dict[str, Column] = {}
        for name in self.names:
            match = pattern.fullmatch(name)
            if match:
                self._claim(found, pattern.pattern, Column(name, match[1] or ""))
        return self._length(next(iter(found.values()))) if found else None

    def sigma_axes(self) -> tuple[Column, ...]:
        found: dict[str, Column] = {}
        for name in self.names:
            match = SIGMA_OF_AXIS.fullmatch(name)
            if match:
                self._claim(found, match[1], Column(name, match[2] or ""))
        for axis in COORDINATES if found else ():
            if axis not in found:
                raise self.missing(f"{SIGMA}_{axis}", f'Column "{SIGMA}_{axis}" is missing')
        self._same_unit(list(found.values()), ONE_UNIT)
        return tuple(self._length(found[axis]) for axis in COORDINATES if found)

    def sigma_turn(self) -> Column | None:
        found: dict[str, Column] = {}
        for name in self.names:
            match = SIGMA_OF_TURN.fullmatch(name)
            if match:
                self._claim(found, SIGMA, Column(name, match[1]))
        return found.get(SIGMA)

    def check_sigmas(self, layout: Layout) -> None:
        """Refuse sigmas of one thing that are stated twice, and names of sigmas that mean nothing."""
        if layout.sigma is not None and layout.sigma_axes:
            self._claim({SIGMA: layout.sigma}, SIGMA, layout.sigma_axes[0])
        strange = [name for name in self.names if name not in self.used and canonical(name).startswith(SIGMA)]
        if strange:
            raise InputError(
                f'column "{strange[0]}" begins with "{SIGMA}" and is none that is known',
                where=self.where,
                rule=f"Known are {SIGMAS}",
                way_out="Rename it; what is no standard deviation of what was measured needs another name, "
                "and counts as a feature",
            )

    def missing(self, name: str, what: str) -> MissingColumnError:
        others = [other for other in self.names if other not in self.used]
        return MissingColumnError(
            what,
            where=self.where,
            rule=did_you_mean(name, others),
            way_out=f"Its columns are {', '.join(self.names[:20])}{' ...' if len(self.names) > 20 else ''}. "
            "Rename them, or bring the file in with: truearm import --map",
        )

    def _claim(self, found: dict[K, Column], key: K, column: Column) -> None:
        if key in found:
            raise InputError(
                f'columns "{found[key].name}" and "{column.name}" mean the same',
                where=self.where,
                way_out="Keep one of them, rename the other",
            )
        found[key] = column
        self.used.add(column.name)

    def _same_unit(self, columns: Sequence[Column], way_out: str) -> None:
        for column in columns[1:]:
            if column.unit != columns[0].unit:
                raise InputError(
                    f'mixed units: column "{columns[0].name}" is in {_unit_in_words(columns[0])}, '
                    f'"{column.name}" in {_unit_in_words(column)}',
                    where=self.where,
                    rule="Columns of the same kind must be in the same unit",
                    way_out=way_out,
                )

    def _is_length(self, index: int, column: Column) -> bool:
        """Whether a joint's column is of a length, by its unit or, where joints are known, by their kind."""
        kinds = self.stated.joints
        prismatic = kinds is not None and index < len(kinds) and kinds[index] == "prismatic"
        return column.unit in LENGTH_UNITS or prismatic

    def _with_stated(self, index: int, column: Column) -> Column:
        return self._stated(
            column, self.stated.length if self._is_length(index, column) else self.stated.angle
        )

    def _length(self, column: Column) -> Column:
        column = self._stated(column, self.stated.length)
        return Column(column.name, column.unit or "m")

    def _stated(self, column: Column, unit: str | None) -> Column:
        if unit and column.unit and column.unit != unit:
            raise UsageError(
                f'column "{column.name}" says {column.unit}, the options say {unit}',
                where=self.where,
                way_out="Leave out the option, or rename the column",
            )
        return Column(column.name, column.unit or unit or "")


def _unit_in_words(column: Column) -> str:
    return column.unit or "SI units, as it names none"


def means_something(name: str) -> bool:
    """Whether a column of this name is no feature: a joint, part of a measurement, or a word about it."""
    patterns = (JOINT, TARGET_COLUMN, *SIGMA_COLUMNS, DISTANCE_COLUMN)
    return name in QUATERNION + WORDS or any(pattern.fullmatch(name) for pattern in patterns)
