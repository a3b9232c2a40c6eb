"""Options as commands take them, those that are no defaults, and what commands have no option for."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from truearm.fits.options import CalibrationOptions
    from truearm.updating import UpdateOptions

RENAMED: Final = {"most_regions": "regions"}
"""Options of a calibration that the command calls otherwise."""
SAID_OTHERWISE: Final = frozenset({"by_purpose", "refit"})
"""Options that the command has another option for."""


def option_words(options: "CalibrationOptions") -> list[str]:
    """The options as `truearm calibrate` takes them, those that are no defaults."""
    from truearm.cli.calibrate import command

    words = _taken(
        command, {name: value for name, value in _of_calibrate(options).items() if name != "holdout"}
    )
    if not options.split.by_purpose and options.split.holdout_range is None:
        words += _given("holdout", options.split.holdout)
    return words if options.refit else [*words, *_given("no_refit", value=True)]


def calibrate_lacks(options: "CalibrationOptions") -> list[str]:
    """A sentence on options that `truearm calibrate` cannot be told, if there are any."""
    from truearm.cli.calibrate import command

    unusual = _of_calibrate(options)
    return _lacking(command, {k: v for k, v in unusual.items() if k not in SAID_OTHERWISE}, "calibrate")


def update_words(options: "UpdateOptions") -> list[str]:
    """The options as `truearm update` takes them, those that are no defaults."""
    from truearm.cli.update import command

    return _taken(command, _of_update(options))


def update_lacks(options: "UpdateOptions") -> list[str]:
    """A sentence on options that `truearm update` cannot be told, if there are any."""
    from truearm.cli.update import command

    return _lacking(command, _of_update(options), "update")


def _of_calibrate(options: "CalibrationOptions") -> dict[str, Any]:
    from truearm.fits.options import CalibrationOptions

    return _unusual(options.to_dict(), CalibrationOptions().to_dict())


def _of_update(options: "UpdateOptions") -> dict[str, Any]:
    from truearm.updating import UpdateOptions

    return _unusual(asdict(options), asdict(UpdateOptions()))


def _unusual(values: Mapping[str, Any], usual: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value != usual[name]}


def _taken(command: Callable[..., None], values: Mapping[str, Any]) -> list[str]:
    """Words of the options that a command has."""
    taken = inspect.signature(command).parameters
    called = {RENAMED.get(name, name): value for name, value in values.items()}
    return [word for name, value in called.items() if name in taken for word in _given(name, value)]


def _lacking(command: Callable[..., None], values: Mapping[str, Any], verb: str) -> list[str]:
    """A sentence on the options that a command does not have, if there are any."""
    taken = inspect.signature(command).parameters
    missing = {name: value for name, value in values.items() if RENAMED.get(name, name) not in taken}
    if not missing:
        return []
    given = ", ".join(f"{name}={value!r}" for name, value in missing.items())
    return [f"The command has no option for {given}: {verb} from Python to keep that."]


def _given(name: str, value: Any) -> list[str]:  # noqa: ANN401
    """An option with its value, or alone where it is a flag."""
    option = f"--{name.replace('_', '-')}"
    if value is True:
        return [option]
    return [option, ",".join(map(str, value)) if isinstance(value, list | tuple) else str(value)]
