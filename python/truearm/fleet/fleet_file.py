"""The fleet file: which arms there are, where their data is, how to calibrate them, what needs attention."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, cast

from pydantic import BeforeValidator, Field
from pydantic.fields import FieldInfo

from truearm.cell.schema import Positive, Section, checked
from truearm.errors import InputError, UsageError
from truearm.files import parsed, read_text
from truearm.fits.core_set import DISTANCE
from truearm.fits.options import CHOICES, CalibrationOptions
from truearm.fits.scheme_options import KNOWN
from truearm.fleet.keys import in_keys
from truearm.rows.splitting import RANGE_FORM
from truearm.units import AngleUnit, LengthUnit

ARM_NAME: Final = re.compile(r"\w(?:[\w .+-]{0,98}[\w+-])?")
PLACEHOLDER: Final = "{arm}"
FOR_THE_FLEET: Final = ("fleet.json", "fleet.csv", "fleet.html")
NOT_OPTIONS: Final = (
    "name",
    "robot",
    "measurements",
    "previous",
    "length_unit",
    "angle_unit",
    "strip",
    "report",
)
Text = Annotated[str, Field(min_length=1)]
Files = Annotated[list[Text], BeforeValidator(lambda given: [given] if isinstance(given, str) else given)]
Number = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]


def _told(rule: Mapping[str, Any]) -> FieldInfo:
    """What the schema tells of a key whose value CalibrationOptions checks."""
    return cast("FieldInfo", Field(json_schema_extra=dict(rule)))


def _one_of(choices: Sequence[object]) -> FieldInfo:
    return _told({"enum": [choice for choice in choices if choice is not None]})


BETWEEN_0_AND_1: Final = _told({"exclusiveMinimum": 0, "exclusiveMaximum": 1})
FROM_ZERO: Final = _told({"minimum": 0})
FROM_ONE: Final = _told({"minimum": 1})
ABOVE_ZERO: Final = _told({"exclusiveMinimum": 0})


class DefaultsSection(Section):
    """What holds for all arms that say nothing else; options as of `truearm calibrate`."""

    robot: Text | None = None
    measurements: Files | None = None
    previous: Text | None = None
    length_unit: LengthUnit | None = None
    angle_unit: AngleUnit | None = None
    strip: bool = False
    report: bool = True
    holdout: Annotated[Number | None, BETWEEN_0_AND_1] = None
    seed: Annotated[Whole | None, FROM_ZERO] = None
    train_size: Annotated[Whole | None, FROM_ONE] = None
    split_by: list[Text] | None = None
    holdout_range: Annotated[str | None, _told({"pattern": f"^{RANGE_FORM.pattern}$"})] = None
    use: Annotated[str | None, _one_of(CHOICES["use"])] = None
    judge_target: Annotated[Whole | None, FROM_ONE] = None
    model: Annotated[str | None, _one_of(CHOICES["model"])] = None
    robust: Annotated[str | None, _one_of(CHOICES["robust"])] = None
    drift: Annotated[str | None, _one_of(CHOICES["drift"])] = None
    features: list[Text] | None = None
    frame: Annotated[str | None, _one_of(CHOICES["frame"])] = None
    refit: bool | None = None
    scheme_joints: list[Whole] | None = None
    demanded_mm: Annotated[Number | None, FROM_ZERO] = None
    most_regions: Annotated[Whole | None, FROM_ONE] = None
    region_rows: Annotated[Whole | None, FROM_ONE] = None
    region_ceps: Annotated[str | None, _one_of(KNOWN["region_ceps"])] = None
    train_on: Annotated[str | None, _one_of(KNOWN["train_on"])] = None
    membership: Annotated[str | None, _one_of(KNOWN["membership"])] = None
    composition: Annotated[str | None, _one_of(KNOWN["composition"])] = None
    repeatability_mm: Annotated[Number | None, ABOVE_ZERO] = None


class ArmSection(DefaultsSection):
    """An arm: what it does not say is that of the defaults."""

    name: Text


class LimitsSection(Section):
    """What an arm may show before it needs attention; errors are those on held-out rows."""

    mean_mm: Positive | None = None
    max_mm: Positive | None = None
    distance_mean_mm: Positive | None = None
    distance_max_mm: Positive | None = None
    drift_mm: Positive | None = None

    def of(self, statistic: str, errors_of: str) -> float | None:
        """The limit of the "mean" or "max" of errors of "position" or "distance", mm; None without one."""
        limit: float | None = getattr(self, limit_key(statistic, errors_of))
        return limit


def limit_key(statistic: str, errors_of: str) -> str:
    """The key of a limit of errors."""
    return f"{'distance_' if errors_of == DISTANCE else ''}{statistic}_mm"


class FleetFile(Section):
    """A fleet file as written."""

    name: Text = "Fleet"
    defaults: dict[str, Any] = Field(default_factory=dict)
    limits: LimitsSection = LimitsSection()
    arm: Annotated[list[dict[str, Any]], Field(min_length=1)]


@dataclass(frozen=True)
class Entry:
    """An arm of the fleet, with its files as they are written, and where they are looked for.

    Attributes:
        name: Name of the arm, and of its directory of results.
        robot: Library name or file.
        measurements: Files, or patterns of files such as "r1/*.csv".
        previous: Its last calibration; None where there is none.
        options: How to calibrate.
        section: The rest of what was stated.
        folder: Where the fleet file is.
    """

    name: str
    robot: str
    measurements: tuple[str, ...]
    previous: str | None
    options: CalibrationOptions
    section: ArmSection
    folder: Path


@dataclass(frozen=True)
class Fleet:
    """A fleet: its arms, in the order of the file."""

    name: str
    limits: LimitsSection
    arms: tuple[Entry, ...]

    @classmethod
    def load(cls, path: str | Path) -> "Fleet":
        """Read a fleet file. The files that it names are not yet looked at.

        Raises:
            InputError: If it is no TOML, a key is unknown or missing, or a value breaks its rule.
        """
        return cls.from_toml(read_text(Path(path)), where=str(path), folder=Path(path).parent)

    @classmethod
    def from_toml(cls, text: str, *, where: str = "fleet", folder: Path = Path()) -> "Fleet":
        """A fleet from the text of its file.

        Raises:
            InputError: As for load.
        """
        return cls.from_dict(parsed(text, where=where), where=where, folder=folder)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any], *, where: str = "fleet", folder: Path = Path()) -> "Fleet":
        """A fleet from the values of its file.

        Raises:
            InputError: As for load.
        """
        file = checked(FleetFile, content, where=where)
        checked(DefaultsSection, file.defaults, where=f"{where}, defaults")
        arms = tuple(
            _entry(number, given, file.defaults, where=where, folder=folder)
            for number, given in enumerate(file.arm, start=1)
        )
        _check_names([arm.name for arm in arms], where)
        return cls(file.name, file.limits, arms)


def _entry(
    number: int, given: Mapping[str, Any], defaults: Mapping[str, Any], *, where: str, folder: Path
) -> Entry:
    named = given.get("name")
    place = f'{where}, arm "{named}"' if isinstance(named, str) else f"{where}, arm {number}"
    section = checked(ArmSection, {**defaults, **given}, where=place)
    _check_name(section.name, place)
    if section.robot is None or not section.measurements:
        missing = "robot" if section.robot is None else "measurements"
        raise InputError(
            f'key "{missing}" is missing',
            where=place,
            rule="Each arm has a robot and measurements",
            way_out="Give it there or in [defaults]",
        )
    previous = section.previous
    return Entry(
        section.name,
        section.robot.replace(PLACEHOLDER, section.name),
        tuple(file.replace(PLACEHOLDER, section.name) for file in section.measurements),
        None if previous is None else previous.replace(PLACEHOLDER, section.name),
        _options(section, place),
        section,
        folder,
    )


def _options(section: ArmSection, place: str) -> CalibrationOptions:
    given = section.model_dump(exclude_none=True, exclude=set(NOT_OPTIONS))
    try:
        return CalibrationOptions.of(**given)
    except UsageError as error:
        rule, way_out = in_keys(error.rule), in_keys(error.way_out)
        raise InputError(error.what, where=error.where, rule=rule, way_out=way_out).at(place) from None


def _check_name(name: str, place: str) -> None:
    if ARM_NAME.fullmatch(name) is None or name.casefold() in FOR_THE_FLEET:
        raise InputError(
            f'"{name}" cannot be the name of an arm',
            where=f"{place}, name",
            rule="It names a directory: letters, digits, blanks and . _ + -, a letter or digit first, at "
            f"most 100, and not {', '.join(FOR_THE_FLEET)}",
        )


def _check_names(names: list[str], where: str) -> None:
    folded = [name.casefold() for name in names]
    for name in names:
        if folded.count(name.casefold()) > 1:
            raise InputError(
                f'the name "{name}" is given twice',
                where=where,
                rule="Names differ, and not only in capitals: each has a directory",
            )
