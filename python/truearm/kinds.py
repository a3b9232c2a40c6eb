"""Arguments of the public calls: whether they are what is needed, and options given in two ways."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from numbers import Integral, Real
from typing import Any, Final, TypeVar

from truearm.errors import UsageError, did_you_mean, list_names

T = TypeVar("T")

WAYS: Final[Mapping[str, str]] = {
    "Calibration": 'Load it: Calibration.load("arm.calib")',
    "Compensator": "Make it of a calibration: Compensator(calibration)",
    "Measurements": "Read them: Measurements.read_csv(path), Measurements.from_dataframe(table)",
    "Robot": 'Load it: Robot.load("ur10"), or from a TOML or URDF file',
}


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


def check_number(value: object, name: str, kind: type = Real) -> None:
    """Raise UsageError unless the argument or option `name` is a number, of `kind` Integral a whole one."""
    if not isinstance(value, kind):
        words = "a whole number" if kind is Integral else "a number"
        raise UsageError(f"{name} is {value!r}", rule=f"It must be {words}")


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
