"""The robot file: its schema in TOML, read with errors that name the file, the key and the rule.

Numbers stay in the file's units here; :mod:`truearm.robot` turns them into SI.
"""

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Annotated, Any, Final, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import ErrorDetails

from truearm.errors import InputError, did_you_mean, list_names
from truearm.files import parsed
from truearm.rotations import UNIT_TOLERANCE
from truearm.units import AngleUnit, LengthUnit

Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Limit = Annotated[float, Field(strict=True)]
Name = Annotated[str, Field(min_length=1)]
Vector3 = Annotated[list[Number], Field(min_length=3, max_length=3)]
Quaternion = Annotated[list[Number], Field(min_length=4, max_length=4)]
ROW_KEYS: Final = ("theta", "d", "a", "alpha", "beta")


def _no_flag(value: object) -> object:
    """What is neither true nor false, which Python takes for 1 and 0."""
    if isinstance(value, bool):
        raise ValueError(f"{str(value).lower()} is no direction; it must be 1 or -1")  # noqa: TRY004 - pydantic's
    return value


Direction = Annotated[Literal[1, -1], BeforeValidator(_no_flag)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Row(_Section):
    """A Denavit-Hartenberg row in the file's units."""

    theta: Number = 0.0
    d: Number = 0.0
    a: Number = 0.0
    alpha: Number = 0.0
    beta: Number = 0.0


class Placement(Row):
    """A fixed transform: a Denavit-Hartenberg row, or xyz (in length_unit) and quaternion_wxyz."""

    xyz: Vector3 | None = None
    quaternion_wxyz: Quaternion | None = None

    @property
    def is_row(self) -> bool:
        """Whether it is given as a Denavit-Hartenberg row."""
        return self.xyz is None and self.quaternion_wxyz is None

    @field_validator("quaternion_wxyz")
    @classmethod
    def _unit(cls, value: list[float] | None) -> list[float] | None:
        if value is not None:
            length = sum(part * part for part in value) ** 0.5
            if abs(length - 1.0) > UNIT_TOLERANCE:
                raise ValueError(f"length {length:.6g}, must be 1 (order w, x, y, z)")
        return value

    @model_validator(mode="after")
    def _one_notation(self) -> "Placement":
        row_keys = self.model_fields_set & set(ROW_KEYS)
        if row_keys and not self.is_row:
            raise ValueError(
                f"gives {list_names(sorted(row_keys))} beside xyz or quaternion_wxyz; "
                "give a Denavit-Hartenberg row, or xyz and quaternion_wxyz"
            )
        return self


class Link(Row):
    """One joint and the row of the table behind it."""

    joint: Literal["revolute", "prismatic"]
    direction: Direction = 1
    limits: Annotated[list[Limit], Field(min_length=2, max_length=2)] | None = None

    @field_validator("limits")
    @classmethod
    def _ordered(cls, value: list[float] | None) -> list[float] | None:
        if value is not None and not value[0] < value[1]:
            raise ValueError(
                f"{value[0]:g} to {value[1]:g}; the lower limit comes first, and a joint that never moves "
                "needs some room too, such as -1 to 1"
            )
        return value


class Coupling(_Section):
    """Joint readings that move more than one joint: q_dh = matrix . (direction * reading)."""

    matrix: list[list[Number]]


class PayloadSection(_Section):
    """What the arm carried."""

    mass_kg: Annotated[Number, Field(ge=0.0)]
    centre_of_gravity_mm: Vector3 | None = None


class UrdfSection(_Section):
    """The names that links and joints have in a URDF."""

    base_link: Name
    joints: list[Name]
    links: list[Name]
    tip_link: Name


class RobotFile(_Section):
    """A robot file as written, in its own units."""

    name: Name
    source: str = ""
    convention: Literal["standard", "modified"]
    length_unit: LengthUnit
    angle_unit: AngleUnit
    base: Placement = Placement()
    link: Annotated[list[Link], Field(min_length=1)]
    flange: Placement = Placement()
    tool: Placement = Placement()
    coupling: Coupling | None = None
    payload: PayloadSection | None = None
    urdf: UrdfSection | None = None

    @model_validator(mode="after")
    def _named(self) -> "RobotFile":
        for key in ("joints", "links"):
            count = len(self.link) if self.urdf is None else len(getattr(self.urdf, key))
            if count != len(self.link):
                raise ValueError(f"urdf.{key} has {count} names, it must have {len(self.link)}, one per link")
        return self

    @model_validator(mode="after")
    def _square(self) -> "RobotFile":
        if self.coupling is not None:
            lengths = {len(row) for row in self.coupling.matrix} | {len(self.coupling.matrix)}
            if lengths != {len(self.link)}:
                raise ValueError(
                    f"coupling.matrix must be {len(self.link)} by {len(self.link)}, "
                    "one row and one column per link"
                )
        return self


def parse_robot_file(text: str, *, where: str) -> RobotFile:
    """Read the text of a robot file.

    Args:
        text: TOML.
        where: Name of the file, for messages.

    Raises:
        InputError: If it is not TOML, a key is unknown or missing, or a value breaks its rule.
    """
    content = parsed(text, where=where)
    try:
        return RobotFile.model_validate(content)
    except ValidationError as error:
        details = error.errors(include_url=False)
        unknown = [detail for detail in details if detail["type"] == "extra_forbidden"]
        raise _translate((unknown or details)[0]).at(where) from None


def _translate(detail: ErrorDetails) -> InputError:
    """One pydantic complaint in our words: key, value, rule."""
    key = _key(detail["loc"])
    value = detail["input"]
    match detail["type"]:
        case "missing":
            return InputError(f'key "{key}" is missing', rule=_rule_of_section(detail["loc"]))
        case "extra_forbidden":
            return _unknown_key(detail["loc"])
        case "value_error":
            return InputError(str(detail["ctx"]["error"]), where=key)
        case "literal_error":
            return InputError(f"{value!r} is not known", where=key, rule=f"Must be {_expected(detail)}")
        case _:
            return InputError(_describe(value), where=key, rule=_rule(detail))


def _unknown_key(location: tuple[int | str, ...]) -> InputError:
    known = _known_keys(location[:-1])
    hint = did_you_mean(str(location[-1]), known)
    return InputError(f'unknown key "{_key(location)}"', rule=hint or f"Known here: {', '.join(known)}")


def _known_keys(location: Iterable[int | str]) -> list[str]:
    """Keys of the section at a location, found by walking the schema."""
    sections: Mapping[str, type[BaseModel]] = {
        "base": Placement,
        "flange": Placement,
        "tool": Placement,
        "link": Link,
        "coupling": Coupling,
        "payload": PayloadSection,
        "urdf": UrdfSection,
    }
    names = [part for part in location if isinstance(part, str)]
    return list((sections[names[0]] if names else RobotFile).model_fields)


def _rule_of_section(location: tuple[int | str, ...]) -> str:
    field = str(location[-1])
    rules: Mapping[str, str] = {
        "convention": 'Either "standard" or "modified"',
        "length_unit": 'Either "m" or "mm"',
        "angle_unit": 'Either "deg" or "rad"',
        "joint": 'Either "revolute" or "prismatic"',
        "link": "One [[link]] section per joint, base to flange",
        "name": "A name for the robot",
    }
    return rules.get(field, "")


def _key(location: Iterable[int | str]) -> str:
    """A pydantic location as a person writes it: ("link", 1, "alpha") is link 2, alpha."""
    words = [f"{part + 1}" if isinstance(part, int) else part for part in location]
    text = words[0] if words else "the file"
    for before, word in pairwise(words):
        text += f" {word}" if before == "link" and word.isdigit() else f", {word}"
    return text


def _expected(detail: ErrorDetails) -> str:
    return str(detail["ctx"]["expected"]).replace("'", '"')


def _describe(value: Any) -> str:  # noqa: ANN401
    return f"{value!r} cannot be used" if len(repr(value)) < 60 else "the value cannot be used"


def _rule(detail: ErrorDetails) -> str:
    context = detail.get("ctx", {})
    rules: Mapping[str, str] = {
        "float_type": "Must be a number",
        "finite_number": "Must be a finite number",
        "string_type": "Must be text in quotes",
        "string_too_short": "Must not be empty",
        "list_type": "Write [[link]], with two brackets, for each"
        if detail["loc"] == ("link",)
        else "Must be a list in square brackets",
        "model_type": "Must be a section of its own",
        "greater_than_equal": f"Must be at least {context.get('ge', 0)}",
        "too_short": f"Must have {context.get('min_length')} entries",
        "too_long": f"Must have {context.get('max_length')} entries",
    }
    return rules.get(detail["type"], detail["msg"])
