"""Arguments and options that several commands have, and what a shell offers for them."""

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias, get_args, get_type_hints

import typer
from typer.models import ParameterInfo

from truearm.description.library import library_names
from truearm.errors import UsageError

CHOICE: Final = re.compile(r"[a-z0-9][a-z0-9_-]*")
ROBOT_HELP: Final = "A library name, a TOML file or a URDF (FILE.urdf#TIP)."


def robots_like(incomplete: str) -> list[str]:
    """Names of the library that begin so; files are offered by the shell where there is none."""
    return [name for name in library_names() if name.startswith(incomplete.lower())]


def words_like(words: Iterable[str]) -> Callable[[str], list[str]]:
    """What a shell offers for a parameter that takes one of `words`."""
    known = list(words)
    return lambda incomplete: [word for word in known if word.startswith(incomplete)]


RobotName: TypeAlias = Annotated[
    str, typer.Argument(metavar="ROBOT", help=ROBOT_HELP, autocompletion=robots_like)
]
CalibFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="CALIB", help="A file that truearm calibrate wrote.")
]
MeasurementFiles: TypeAlias = Annotated[
    list[Path],
    typer.Argument(
        metavar="MEASUREMENTS...", help="CSV files, each a set-up of its own, or with a column group."
    ),
]
CellFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="CELL", help="A cell file: arm, devices and their ports.")
]
SessionFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="SESSION", help="A file that truearm measure wrote.")
]
OutputDirectory: TypeAlias = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Where the results go.")
]
AsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")]
Scheduler: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Work on the Dask cluster with this scheduler: tcp://HOST:8786."),
]
Workers: TypeAlias = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, help="Local processes at the most.  [default: one a processor]"),
]
LengthUnit: TypeAlias = Annotated[
    str | None, typer.Option(metavar="mm|m", help="Unit of columns that name none.")
]
AngleUnit: TypeAlias = Annotated[
    str | None, typer.Option(metavar="deg|rad", help="Unit of joint columns that name none.")
]
Use: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="position|pose|targets",
        help="What to use.  [default: several targets, else poses, as measured]",
    ),
]

Feature: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="Value of a feature that the calibration needs; repeat."),
]
Task: TypeAlias = Annotated[
    str, typer.Option(metavar="pose|axis|position", help="What of the tool is to be met.")
]
Moving: TypeAlias = Annotated[
    str | None, typer.Option(metavar="1,2,3", help="Joints that may change.  [default: all]")
]
LargestMm: TypeAlias = Annotated[float, typer.Option(help="Largest shift of the tool.")]
LargestDeg: TypeAlias = Annotated[float, typer.Option(help="Largest turn of the tool.")]
LargestStdMm: TypeAlias = Annotated[
    float, typer.Option(help="Largest standard deviation of the tool's position.")
]


def features_of(stated: Sequence[str] | None) -> dict[str, float]:
    """Values by name of the words of :data:`Feature`, such as "temperature=21.5".

    Raises:
        UsageError: If one is not NAME=VALUE with a number, or a feature has two values.
    """
    found: dict[str, float] = {}
    for text in stated or ():
        name, _, value = (part.strip() for part in text.partition("="))
        try:
            number = float(value)
        except ValueError:
            rule = "It must be NAME=VALUE with a number, such as temperature=21.5"
            raise UsageError(f'"{text}"', where="--feature", rule=rule) from None
        if name in found:
            raise UsageError(f'"{name}" has two values', where="--feature", rule="A feature has one")
        found[name] = number
    return found


def joints_of(stated: str | None) -> list[int] | None:
    """Numbers of joints of the words of :data:`Moving`, such as "1,2,3"; None for all.

    Raises:
        UsageError: If they are no numbers.
    """
    if stated is None:
        return None
    try:
        return [int(part) for part in stated.split(",")]
    except ValueError:
        rule = "It must be numbers of joints with commas, such as 1,2,3"
        raise UsageError(f'"{stated}"', where="--moving", rule=rule) from None


def one_of(option: str, stated: str, choices: Any) -> Any:  # noqa: ANN401
    """`stated`, which has to be one of `choices`, a Literal.

    Raises:
        UsageError: If it is none of them.
    """
    allowed = get_args(choices)
    if stated not in allowed:
        raise UsageError(f'"{stated}"', where=option, rule=f"It must be {' or '.join(allowed)}")
    return stated


def offer_choices(function: Callable[..., Any]) -> None:
    """Let a shell offer the words of metavars such as "mm|m" for the parameters of a command."""
    for hint in get_type_hints(function, include_extras=True).values():
        for stated in getattr(hint, "__metadata__", ()):
            if isinstance(stated, ParameterInfo) and stated.autocompletion is None:
                words = choices_of(str(stated.metavar or ""))
                stated.autocompletion = words_like(words) if words else None


def choices_of(metavar: str) -> list[str]:
    """The words that a metavar lists; none where it stands for something else."""
    parts = metavar.split("|")
    return [part for part in parts if CHOICE.fullmatch(part)] if len(parts) > 1 else []
