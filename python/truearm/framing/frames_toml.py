"""Frames that were found, written into a frames file beside what it holds already."""

import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomli_w
import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Item

from truearm.errors import Notice, UsageError
from truearm.files import parsed, read_text, write_whole
from truearm.framing.identified_frame import IdentifiedFrame
from truearm.locks import held
from truearm.programs.environment import Frame
from truearm.programs.frames import LENGTHS_M, ORIENTATIONS, WORLDS, FrameEntry, Frames
from truearm.rotations import quaternion_from_matrix
from truearm.strictly import strictly
from truearm.types import AXES, Floats
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

PLACEMENT: Final = ("xyz", *ORIENTATIONS)
FORMAT: Final = 1
WAIT_S: Final = 30.0
"""For how long a process waits for others that write into the same file, each for a fraction of a second."""
DECIMALS: Final = 6
CONTROLLERS: Final = (
    'already; what it held stands under "controller" now, as what the controller computes with. Take it out '
    "when the new numbers are in the controller"
)
FOUND_BEFORE: Final = (
    "as it was found before, {}; the new numbers replace that. If the controller computes with the former "
    'ones, state them under "controller"'
)


def former_entry(path: str | Path, kind: str, name: str) -> tuple[FrameEntry, float] | None:
    """What a frames file, if it is there, says of a tool or object, and its length unit in m.

    Raises:
        InputError: If the file breaks a rule.
    """
    content = parsed(_text(Path(path)), where=str(path))
    key = _key(content, kind, name)
    if key is None:
        return None
    unit = LENGTHS_M[content.get("length_unit", "mm")]
    return strictly(FrameEntry, content[kind][key]), unit


def tip_covariance(entry: FrameEntry) -> Floats | None:
    """Covariance of a tool's tip along the flange's axes (3, 3), m^2, if the entry was identified."""
    return None if entry.covariance is None else entry.covariance[:3, :3]


def write_frame(path: str | Path, name: str, found: IdentifiedFrame, data_hash: str) -> list[Notice]:
    """Write a frame into a file, which is made if it is not there; other frames stay.

    Where the file held the frame already, what it held becomes what the controller has, unless it said
    what the controller has, or was found too: then the new numbers replace it. An object is written in the
    controller's world where the file has that. Comments of the file stay where they can. Processes that
    write into the same file do so one after another, and what each of them found is in it.

    Raises:
        UsageError: If the name is blank.
        InputError: If the file breaks a rule or cannot be written, or has two worlds.
        WorkError: If another process does not come to an end of writing into it.
    """
    if not name.strip():
        raise UsageError(f'the name of the {found.kind} is "{name}"', rule="Programs call it by a name")
    place = os.path.realpath(path)
    lock = held(place, "writes into this file", where=str(path), wait_s=WAIT_S)
    try:
        return _written(path, name, found, data_hash)
    finally:
        lock.release()


def _written(path: str | Path, name: str, found: IdentifiedFrame, data_hash: str) -> list[Notice]:
    """Read a file, put a frame into it and write it, as write_frame."""
    before = _text(Path(path))
    content = parsed(before, where=str(path))
    world = _world(before, found.kind, name, where=str(path))
    told = found if world is None else found.told_in(world.true)
    identified = _identified(told, data_hash, "base" if world is None else f"world, {world.name}")
    words = _put(content, name, told, identified)
    edited = _edited(before, lambda document: _put(document, name, told, identified))
    text = edited if _says(edited, content) else tomli_w.dumps(content)
    Frames.parse(text, where=str(path))
    write_whole(Path(path), text)
    former = [Notice("former_frame", f'{path} held {told.kind} "{name}" {each}') for each in words]
    return [*_world_notices(path, name, told, world), *former]


def _world(held: str, kind: str, name: str, *, where: str) -> Frame | None:
    """The world that the frame is told in, of the text of a file; None for the arm's base and the flange."""
    if kind == "tool" or name.casefold() in {world.casefold() for world in WORLDS}:
        return None
    return Frames.parse(held, where=where).world()


def _world_notices(path: str | Path, name: str, told: IdentifiedFrame, world: Frame | None) -> list[Notice]:
    if world is None:
        return []
    x, y, z = MM_PER_METRE * told.transform[:3, 3]
    return [
        Notice(
            "world",
            f'{path} has the controller\'s world, object "{world.name}": object "{name}" is written in it, '
            f"as the controller holds objects, at {x:.3f} {y:.3f} {z:.3f} mm. All else that is printed is in "
            "the arm's base",
        )
    ]


def _put(content: Any, name: str, told: IdentifiedFrame, identified: dict[str, Any]) -> list[str]:  # noqa: ANN401
    """Put a frame into plain values or into a document with comments; gives what became of a former one."""
    content.setdefault("format", FORMAT)
    unit = LENGTHS_M[str(content.setdefault("length_unit", "mm"))]
    written = {**_placement(told.transform, unit), "identified": identified}
    key = _key(content, told.kind, name)
    if key is None:
        content.setdefault(told.kind, {})[name] = written
        return []
    entry = content[told.kind][key]
    was_found, states_controller = "identified" in entry, "controller" in entry
    former = {part: _plain(entry.pop(part)) for part in PLACEMENT if part in entry}
    entry.update(written)
    if not former or states_controller:
        return []
    if was_found:
        return [FOUND_BEFORE.format(", ".join(f"{part} = {_rounded(of)}" for part, of in former.items()))]
    entry["controller"] = former
    return [CONTROLLERS]


def _rounded(values: Sequence[float]) -> list[float]:
    return [round(value, DECIMALS) for value in values]


def _plain(value: Any) -> Any:  # noqa: ANN401
    return value.unwrap() if isinstance(value, Item) else value


def _edited(text: str, put: Callable[[Any], object]) -> str:
    """The text with something put in and its comments kept; empty where the library cannot.

    Tables that are written in pieces, as TOML allows, are more than it can put something into.
    """
    try:
        document = tomlkit.parse(text)
        put(document)
        return tomlkit.dumps(document)
    except (IndexError, KeyError, TypeError, ValueError, TOMLKitError):
        return ""


def _says(text: str, content: Mapping[str, Any]) -> bool:
    """Whether a text is TOML that says just this."""
    try:
        return tomllib.loads(text) == content
    except tomllib.TOMLDecodeError:
        return False


def _text(path: Path) -> str:
    """What a frames file holds that keeps to its rules; nothing if it is not there."""
    if not path.exists():
        return ""
    Frames.load(path)
    return read_text(path)


def _key(content: Mapping[str, Any], kind: str, name: str) -> str | None:
    """The file's own spelling of a name."""
    return next((key for key in content.get(kind, {}) if key.casefold() == name.casefold()), None)


def _placement(transform: Floats, unit_m: float) -> dict[str, Any]:
    return {
        "xyz": (transform[:3, 3] / unit_m).tolist(),
        "quaternion_wxyz": quaternion_from_matrix(transform[:3, :3]).tolist(),
    }


def _identified(found: IdentifiedFrame, data_hash: str, outer: str) -> dict[str, Any]:
    """How well a frame is known; `outer` is what an object is told in."""
    units = np.repeat([MM_PER_METRE, MRAD_PER_RAD], AXES)
    return {
        "how": found.how,
        "residual_mm": float(np.sqrt(np.square(found.distances_mm).mean())),
        "largest_mm": float(found.distances_mm.max()),
        "std_mm": found.std_mm.tolist(),
        "std_mrad": found.std_mrad.tolist(),
        "covariance": (found.covariance * np.outer(units, units)).tolist(),
        "covariance_of": "x, y, z in mm and rotation vector in mrad, along the axes of "
        + ("the flange" if found.kind == "tool" else f"the {outer}"),
        "calibration": data_hash,
    }
