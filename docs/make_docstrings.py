"""Write docs/reference/python-docstrings.md from the docstrings of what is public.

Members and attributes whose docstring begins with "Internal:" are left out, as other modules are. A class
that says what makes one, in a line such as "`update` makes one.", is not shown as a call.
"""

import dataclasses
import inspect
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from truearm.kinds import Kept

PAGE = Path(__file__).parent / "reference" / "python-docstrings.md"
HEAD = """# Python, from its docstrings

This page is made from the docstrings; [Python](python-api.md) shows how the parts are used together. Angles
are in rad and lengths in m where no unit is in a name. Shapes are in parentheses: n poses, N joints.
"""
MODULES = {
    "truearm": (),
    "truearm.judgement.validation": ("Validation", "Errors", "Statistics", "RowErrors"),
    "truearm.judgement.held_rows": ("HeldRows",),
    "truearm.fits.details": ("ConstantDetails", "VariableDetails", "DriftDetails", "Jump"),
    "truearm.fits.known_scale": ("KnownScale",),
    "truearm.fits.identifiability": ("Identifiability",),
    "truearm.fits.fitted_rows": ("FittedRows",),
    "truearm.updating.moved": ("Offset", "Motion"),
    "truearm.updating.other_cause": ("OtherCause",),
    "truearm.updating.squares": ("SquaresTest",),
    "truearm.programs.program": ("Listed",),
    "truearm.programs.densify": ("Spacing",),
    "truearm.fits.scheme_options": ("SchemeOptions",),
    "truearm.simulation": ("VirtualArm", "Imperfections"),
    "truearm.inverse": ("Inverse",),
    "truearm.planning": (),
    "truearm.proposing": (),
    "truearm.exporting": (),
    "truearm.framing": (),
    "truearm.streaming": ("CorrectionStream", "StreamOptions"),
    "truearm.cell": (),
    "truearm.cell.conformance": ("check_robot", "check_sensor", "ConformanceError"),
    "truearm.fleet": (),
    "truearm.workers": ("run_tasks",),
}
INTERNAL = "Internal:"
MADE = re.compile(r"^`.*` makes? one\b", re.MULTILINE)
SECTION = re.compile(r"^(Args|Attributes|Raises|Returns|Yields):$")
ITEM = re.compile(r"^ {4}(\*{0,2}\w+(?:, \*{0,2}\w+)*): (.*)$")
STARS: dict[Any, str] = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
ROLE = re.compile(r":\w+:`~?\.?([^`]+)`")


def page() -> str:
    """The page as it has to be."""
    lines = [HEAD]
    for module, names in MODULES.items():
        known = import_module(module)
        lines.append(f"## {module}\n")
        for name in sorted(names or known.__all__, key=str.lower):
            lines += _thing(name, getattr(known, name))
    return "\n".join(lines)


def _thing(name: str, thing: Any) -> Iterator[str]:
    if not (inspect.isclass(thing) or inspect.isfunction(thing)):
        return
    yield f"### {name}\n\n{'' if _is_plain(thing) else _call(name, thing)}{_markdown(thing)}"
    if inspect.isclass(thing):
        for own, called, member in _members(thing):
            yield f"#### {name}.{own}\n\n{called}{_markdown(member)}"


def _is_plain(thing: Any) -> bool:
    """Whether a signature says nothing: exceptions, protocols, and what is made in other ways."""
    if not inspect.isclass(thing):
        return False
    made = MADE.search(inspect.getdoc(thing) or "")
    return bool(made) or issubclass(thing, Exception) or getattr(thing, "_is_protocol", False)


def _members(kind: type) -> Iterator[tuple[str, str, Any]]:
    """Name, call and what is documented of the public methods and properties of a class's own."""
    for name, member in vars(kind).items():
        words = inspect.getdoc(member)
        if name.startswith("_") or isinstance(member, type) or not words or words.startswith(INTERNAL):
            continue
        function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if inspect.isfunction(function):
            before = kind.__name__ if function is not member else instance_of(kind.__name__)
            yield name, _call(f"{before}.{name}", function), function
        elif hasattr(member, "__get__") and not isinstance(member, Kept):
            yield name, "", member


def instance_of(kind: str) -> str:
    """What an instance of a class is called in calls: `CalibrationOptions` is `calibration_options`."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind).lower()


def _call(name: str, thing: Any) -> str:
    return f"`{name}{_signature(thing)}`\n\n"


def _signature(thing: Any) -> str:
    """Names and plain defaults of the parameters; docstrings have shapes and units."""
    shown: list[str] = []
    parameters = inspect.signature(thing).parameters.values()
    for place, parameter in enumerate(parameters):
        if place == 0 and parameter.name in ("self", "cls"):
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and "*" not in "".join(shown):
            shown.append("*")
        stars = STARS.get(parameter.kind, "")
        shown.append(f"{stars}{parameter.name}{_default(parameter.default)}")
    return f"({', '.join(shown)})"


def _default(value: Any) -> str:
    if value is inspect.Parameter.empty:
        return ""
    plain = value is None or isinstance(value, bool | int | float | str) or value == ()
    return f"={value!r}" if plain else "=..."


def _markdown(thing: Any) -> str:
    """A docstring of Google's form as Markdown: items of sections become a list, examples code."""
    if dataclasses.is_dataclass(thing) and str(thing.__doc__).startswith(
        f"{getattr(thing, '__name__', '')}("
    ):
        return "A record of its arguments.\n"
    lines: list[str] = []
    section = ""
    for line in _shown_lines(ROLE.sub(r"`\1`", inspect.getdoc(thing) or "")):
        head = SECTION.match(line)
        item = ITEM.match(line) if section in ("Args", "Attributes", "Raises") else None
        if head:
            section = head[1]
            lines += [f"*{'Arguments' if section == 'Args' else section}*", ""]
        elif item:
            lines.append(f"- `{item[1]}`: {item[2]}")
        elif section and line.startswith("    "):
            lines.append(f"  {line.strip()}" if section in ("Args", "Attributes", "Raises") else line.strip())
        else:
            section = "" if line.strip() else section
            lines.append(line)
    return "\n".join(lines) + "\n"


def _shown_lines(text: str) -> Iterator[str]:
    """The lines of a docstring without items that begin with "Internal:"."""
    hidden = False
    for line in text.splitlines():
        item = ITEM.match(line)
        if item or not line.startswith(" " * 5):
            hidden = item is not None and item[2].startswith(INTERNAL)
        if not hidden:
            yield line


if __name__ == "__main__":
    PAGE.write_text(page())
    sys.stdout.write(f"written to {PAGE}\n")
