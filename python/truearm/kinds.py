"""Arguments of the public calls: whether they are what is needed, and options given in two ways."""

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import fields
from numbers import Integral, Real
from typing import Any, Final, Generic, TypeVar

from truearm.errors import UsageError, did_you_mean, list_names

T = TypeVar("T")
Given = TypeVar("Given")
Held = TypeVar("Held")

WAYS: Final[Mapping[str, str]] = {
    "Calibration": 'Load it: Calibration.load("arm.calib")',
    "Candidates": "Make them of poses: Candidates(calibration, readings)",
    "Compensator": "Make it of a calibration: Compensator(calibration)",
    "Controller": "Declare it: Controller.nominal(robot), Controller.load(path)",
    "IdentifiedArm": "Make it of a robot: truearm.fits.identified.IdentifiedArm(robot)",
    "Measurements": "Read them: Measurements.read_csv(path), Measurements.from_dataframe(table)",
    "Robot": 'Load it: Robot.load("ur10"), or from a TOML or URDF file',
}


class Kept(Generic[Given, Held]):
    """A field of a dataclass that is given in one type and held in another, for type checkers as well."""

    def __init__(self, made: Callable[[Given, str], Held], usual: Held) -> None:
        """`made` turns what is given, and the field's name, into what is held; `usual` is held by default."""
        self._made, self._usual, self._name = made, usual, ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, options: object | None, kind: type | None = None) -> Held:
        return self._usual if options is None else options.__dict__[self._name]

    def __set__(self, options: object, given: Given) -> None:
        options.__dict__[self._name] = self._made(given, self._name)


Names = Kept[str | Sequence[str], tuple[str, ...]]
Numbers = Kept[Iterable[int], tuple[int, ...]]

SIZES: Final = (1e-6, 1e6)
"""What sizes in mm, deg or mrad are between: a nanometre, and a kilometre. Nothing is known more closely than
that, and what is far beyond leaves no digits to the numbers that it meets.
"""
NO_CHOICES: Final[Mapping[str, Sequence[object]]] = {}


def required(value: object, kind: type[T], noun: str) -> T:
    """`value`, which has to be of a kind; `noun` is what it stands for.

    Raises:
        UsageError: If it is of another type.
    """
    if isinstance(value, kind):
        return value
    raise UsageError(
        f"{noun} {'are' if noun.endswith('s') else 'is'} of type {type(value).__name__}",
        rule=f"A {kind.__module__.partition('.')[0]}.{kind.__name__} is needed",
        way_out=WAYS.get(kind.__name__, ""),
    )


def settle(
    options: object, *, whole: Sequence[str] = (), numbers: Sequence[str] = (), flags: Sequence[str] = ()
) -> None:
    """Check fields of a frozen dataclass and make them int, float and bool, which JSON can hold.

    A field that is None by default may be None.

    Args:
        options: The dataclass, in its __post_init__.
        whole: Names of the fields that are whole numbers.
        numbers: Names of those that are numbers.
        flags: Names of those that are true or false.

    Raises:
        UsageError: If a field holds anything else.
    """
    kinds: list[tuple[Sequence[str], Callable[[object, str], object]]] = [
        (whole, _whole),
        (numbers, _real),
        (flags, _flag),
    ]
    optional = [field.name for field in fields(options) if field.default is None]  # type: ignore[arg-type]
    for names, made in kinds:
        for name in names:
            value = getattr(options, name)
            if value is not None or name not in optional:
                object.__setattr__(options, name, made(value, name))


def check_values(
    options: object,
    *,
    choices: Mapping[str, Sequence[object]] = NO_CHOICES,
    positive: Sequence[str] = (),
    sizes: Sequence[str] = (),
    not_negative: Sequence[str] = (),
) -> None:
    """Check what the fields of a dataclass hold, once they are of their kinds.

    Args:
        options: The dataclass.
        choices: What the fields may hold that are one of a few.
        positive: Names of the numbers that are above zero and finite, or None.
        sizes: Names of the lengths in mm and angles in deg or mrad that are above zero, or None: as SIZES.
        not_negative: Names of those that are zero or more, and finite, or None.

    Raises:
        UsageError: If a field holds anything else.
    """
    for name, known in choices.items():
        check_choice(getattr(options, name), name, known)
    for name in positive:
        check_positive(getattr(options, name), name)
    for name in sizes:
        check_size(getattr(options, name), name)
    for name in not_negative:
        if (value := getattr(options, name)) is not None and not 0 <= value < math.inf:
            raise UsageError(f"{value:g}", where=name, rule="Zero or more, and finite")


def check_positive(value: float | None, name: str) -> None:
    """Raise UsageError unless the argument or option `name` is above zero and finite, or None."""
    if value is not None and not 0 < value < math.inf:
        raise UsageError(f"{value:g}", where=name, rule="It must be positive and finite")


def check_size(value: float | None, name: str) -> None:
    """Raise UsageError unless a length in mm, or an angle in deg or mrad, is as SIZES say, or None."""
    check_positive(value, name)
    least, most = SIZES
    if value is not None and not least <= value <= most:
        raise UsageError(
            f"{value:g}",
            where=name,
            rule=f"At least {least:g} and at most {most:,.0f}, in {name.rpartition('_')[2]}",
        )


def check_choice(value: object, name: str, known: Sequence[object]) -> None:
    """Raise UsageError unless the argument or option `name` is one of those known; None is not named."""
    if value not in known:
        words = [str(choice) for choice in known if choice is not None]
        raise UsageError(
            f'"{value}" is not known',
            where=name,
            rule=f"Either {' or '.join(words)}",
            way_out=did_you_mean(str(value), words),
        )


def whole_numbers(values: object, name: str) -> tuple[int, ...]:
    """Whole numbers that the option `name` holds, one or several.

    Raises:
        UsageError: If it is not a list of whole numbers.
    """
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise UsageError(f"{name} is {values!r}", rule="It must be a list of whole numbers")
    return tuple(_whole(value, f"a number of {name}") for value in values)


def words(value: object, name: str) -> tuple[str, ...]:
    """Names that the option `name` holds, as one text with commas or one by one.

    Raises:
        UsageError: If it is neither a text nor a list of texts.
    """
    if isinstance(value, str):
        return tuple(part.strip() for part in value.split(","))
    if not isinstance(value, Iterable) or isinstance(value, bytes | set | frozenset):
        rule = "It must be a list of names" + (", as a set has no order" if isinstance(value, Set) else "")
        raise UsageError(f"{name} is {value!r}", rule=rule)
    return tuple(text(part, f"a name of {name}") for part in value)


def text(value: object, name: str) -> str:
    """The argument or option `name`, which is a text.

    Raises:
        UsageError: If it is anything else.
    """
    if not isinstance(value, str):
        raise UsageError(f"{name} is {value!r}", rule="It must be a text")
    return str(value)


def name(value: object, argument: str) -> str:
    """The name that an argument is: a text, or a whole number, as tables give names that are such.

    Raises:
        UsageError: If it is anything else.
    """
    is_number = isinstance(value, Integral) and not isinstance(value, bool)
    if is_number or isinstance(value, str):
        return str(value)
    raise UsageError(f"{argument} is {value!r}", rule="It must be a name, a text or a whole number")


def content_bytes(content: object, noun: str) -> bytes:
    """The bytes of a file's content, which may be a bytearray or a memoryview; `noun` is what it is.

    Raises:
        UsageError: If it is anything else.
    """
    if isinstance(content, bytes):
        return content
    if isinstance(content, bytearray | memoryview):
        return bytes(content)
    raise UsageError(
        f"{noun} is of type {type(content).__name__}",
        rule="Bytes are needed",
        way_out="Read the file as bytes, or load it by its path",
    )


def count(value: object, name: str) -> int:
    """The argument or option `name`, which is a whole number from zero on.

    Raises:
        UsageError: If it is anything else.
    """
    found = _whole(value, name)
    if found < 0:
        raise UsageError(f"{name} is {found}", rule="Zero or more")
    return found


def _whole(value: object, name: str) -> int:
    check_number(value, name, Integral)
    return int(value)  # type: ignore[call-overload, no-any-return]


def _real(value: object, name: str) -> float:
    check_number(value, name)
    return float(value)  # type: ignore[arg-type]


def _flag(value: object, name: str) -> bool:
    """True or False, also as NumPy has them: the command line's help comes without NumPy."""
    if not isinstance(value, bool) and str(getattr(value, "dtype", "")) != "bool":
        raise UsageError(f"{name} is {value!r}", rule="It must be True or False")
    return bool(value)


def check_number(value: object, name: str, kind: type = Real) -> None:
    """Raise UsageError unless the argument or option `name` is a number, of `kind` Integral a whole one.

    True and False are none, nor is what no float can hold.
    """
    if isinstance(value, bool) or not isinstance(value, kind):
        words = "a whole number" if kind is Integral else "a number"
        raise UsageError(f"{name} is {value!r}", rule=f"It must be {words}")
    try:
        float(value)  # type: ignore[arg-type]
    except OverflowError:
        largest = f"{sys.float_info.max:.2g}"
        raise UsageError(f"{name} is beyond {largest}", rule=f"It must be at most {largest}") from None


def chosen(
    kind: type[T], given: T | None, more: Mapping[str, Any], make: Callable[..., T] | None = None
) -> T:
    """Options as an object, or made of keywords.

    Args:
        kind: Type of the options.
        given: The object.
        more: The keywords.
        make: What makes options of keywords and checks their names; the type itself by default.

    Raises:
        UsageError: If both are given, the object is of another type, or there is no such option.
    """
    if given is not None:
        if more:
            raise UsageError(
                "options were given both ways", rule=f"Give an object of {kind.__name__}, or keywords"
            )
        return required(given, kind, "the options")
    if make is not None:
        return make(**more)
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    for name in more:
        check_name(name, known)
    return kind(**more)


def check_name(name: str, known: list[str]) -> None:
    """Raise UsageError unless `name` is a known option."""
    if name not in known:
        raise UsageError(
            f'there is no option "{name}"',
            rule=f"There are {list_names(sorted(known))}",
            way_out=did_you_mean(name, known),
        )
