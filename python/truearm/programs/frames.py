"""The frames file: tools and work objects that a program does not hold, or that were taught wrongly.

A TOML file with a table `[tool.NAME]` or `[object.NAME]` a frame; docs/reference/programs.md has all keys.
"""

from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from truearm.errors import InputError
from truearm.files import as_path, parsed, read_text
from truearm.programs.environment import Frame
from truearm.rotations import (
    UNIT_TOLERANCE,
    matrix_from_euler,
    matrix_from_rotation_vector,
    transform_from_parts,
)
from truearm.strictly import strictly
from truearm.types import Transform

Kind = Literal["tool", "object"]
Written = TypeVar("Written", bound=Hashable)
Number = Annotated[float, Field(allow_inf_nan=False)]
LENGTHS_M: Final = {"mm": 1e-3, "m": 1.0}
MM_AND_MRAD: Final = 1e-3
"""Unit of an entry's covariance, whatever the file's unit of lengths: mm and mrad."""
ORIENTATIONS: Final = ("quaternion_wxyz", "euler_zyx_deg", "rotation_vector_rad")
KRL_WORLD: Final = "$WORLD"
RAPID_WORLD: Final = "wobj0"
WORLDS: Final = (KRL_WORLD, RAPID_WORLD)
"""Objects that are a controller's world in the arm's base; the other objects of its programs are in it."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Placement(_Section):
    """A transform: xyz in the file's unit, and one notation of the orientation or none."""

    xyz: tuple[Number, Number, Number]
    quaternion_wxyz: tuple[Number, Number, Number, Number] | None = None
    euler_zyx_deg: tuple[Number, Number, Number] | None = None
    rotation_vector_rad: tuple[Number, Number, Number] | None = None

    @field_validator("quaternion_wxyz")
    @classmethod
    def _unit(cls, value: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if value is not None and abs(np.linalg.norm(value) - 1.0) > UNIT_TOLERANCE:
            raise ValueError(f"length {np.linalg.norm(value):.6g}, must be 1 (order w, x, y, z)")
        return value

    @model_validator(mode="after")
    def _one_notation(self) -> "Placement":
        given = [name for name in ORIENTATIONS if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"gives {' and '.join(given)}; give one of them")
        return self

    def transform(self, unit_m: float) -> Transform:
        """The transform (4, 4), m."""
        quaternion = self.quaternion_wxyz or (1.0, 0.0, 0.0, 0.0)
        transform = transform_from_parts(np.array(self.xyz) * unit_m, quaternion)
        if self.euler_zyx_deg is not None:
            transform[:3, :3] = matrix_from_euler(np.deg2rad(self.euler_zyx_deg), "ZYX")
        if self.rotation_vector_rad is not None:
            transform[:3, :3] = matrix_from_rotation_vector(self.rotation_vector_rad)
        return transform


class FrameEntry(Placement):
    """A tool or an object: where it is, what the controller believes, and how well that is known."""

    controller: Placement | None = None
    payload_kg: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None
    identified: Mapping[str, Any] | None = None

    @field_validator("identified")
    @classmethod
    def _six_by_six(cls, value: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
        if value is None or "covariance" not in value:
            return value
        try:
            covariance = np.array(value["covariance"], dtype=np.float64)
        except (TypeError, ValueError):
            covariance = np.empty(0)
        if covariance.shape != (6, 6) or not np.isfinite(covariance).all() or (np.diag(covariance) < 0).any():
            raise ValueError("a covariance has six rows of six numbers, and its diagonal no negative ones")
        return value

    @property
    def covariance(self) -> NDArray[np.float64] | None:
        """Of translation and rotation vector along the outer axes (6, 6), SI, where the entry tells it."""
        stated = (self.identified or {}).get("covariance")
        return None if stated is None else np.array(stated, dtype=np.float64) * MM_AND_MRAD**2


class FramesFile(_Section):
    """The whole file."""

    format: Literal[1] = 1
    length_unit: Literal["mm", "m"] = "mm"
    tool: Mapping[str, FrameEntry] = Field(default_factory=dict)
    object: Mapping[str, FrameEntry] = Field(default_factory=dict)


class Asked:
    """Names under which a program's tools and objects were looked up.

    Attributes:
        names: Each as the program has it, by kind, "tool" or "object", and by the name with case ignored.
        initial: Those of what holds until a program sets another.
    """

    def __init__(self) -> None:
        self.names: dict[Kind, dict[str, str]] = {"tool": {}, "object": {}}
        self.initial: dict[Kind, dict[str, str]] = {"tool": {}, "object": {}}


@dataclass(frozen=True, eq=False)
class Frames:
    """Tools and objects by name; names are compared with case ignored.

    Attributes:
        tools: flange_from_tool of each.
        objects: Each as the controller holds it: in the controller's world where the file has that (WORLDS),
            else in the arm's base.
        payloads_kg: Payloads of the tools that state one.
        where: The file, for messages; empty without one.
        asked: Internal: what was looked up.
    """

    tools: Mapping[str, Frame] = field(default_factory=dict)
    objects: Mapping[str, Frame] = field(default_factory=dict)
    payloads_kg: Mapping[str, float] = field(default_factory=dict)
    where: str = ""
    asked: Asked = field(default_factory=Asked, init=False, repr=False)

    @classmethod
    def load(cls, path: str | Path) -> "Frames":
        """The frames of a file.

        Raises:
            InputError: If it cannot be read or breaks a rule; names the key.
        """
        return cls.parse(read_text(as_path(path)), where=str(path))

    @classmethod
    def parse(cls, text: str, *, where: str = "frames") -> "Frames":
        """The frames of the text of a file."""
        try:
            content = strictly(FramesFile, parsed(text, where=where))
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(str(part) for part in first["loc"])
            raise InputError(
                f'"{key}" is wrong: {first["msg"]}',
                where=where,
                way_out="docs/reference/programs.md has the keys of a frames file",
            ) from None
        unit = LENGTHS_M[content.length_unit]
        return cls(
            {key: _frame(name, entry, unit) for key, name, entry in _folded("tool", content.tool, where)},
            {key: _frame(name, entry, unit) for key, name, entry in _folded("object", content.object, where)},
            {n.casefold(): e.payload_kg for n, e in content.tool.items() if e.payload_kg is not None},
            where,
        )

    def fresh(self) -> "Frames":
        """Internal: the same, of which nothing was looked up."""
        return replace(self)

    def tool(self, name: str, stated: Transform | None = None) -> Frame:
        """The tool of that name; `stated` is what the program says, if it says, and what the controller has.

        A tool that the program states and the file holds is aimed with as the file has it: the file's
        is where the tool truly is. One that neither has is unknown.
        """
        return self._found("tool", name, stated)

    def work_object(self, name: str, stated: Transform | None = None) -> Frame:
        """The work object of that name, likewise."""
        return self._found("object", name, stated)

    def held(self, kind: Kind, name: str) -> Frame | None:
        """Internal: the tool or object of that name where the file holds it."""
        self.asked.names[kind].setdefault(name.casefold(), name)
        return self.of(kind).get(name.casefold())

    def world(self) -> Frame | None:
        """The controller's world in the arm's base; None where the file has none.

        Raises:
            InputError: If it has those of two controllers, and they are different places.
        """
        found = [self.objects[name.casefold()] for name in WORLDS if name.casefold() in self.objects]
        if len(found) > 1 and not np.allclose(found[0].true, found[1].true, rtol=0.0, atol=1e-9):
            raise InputError(
                f"it has two worlds, {' and '.join(one.name for one in found)}, at different places",
                where=self.where,
                rule="Objects are told in the world of their controller",
                way_out="Give each controller a frames file of its own",
            )
        return found[0] if found else None

    def at_start(self, kind: Kind, name: str) -> Frame:
        """Internal: what holds until the program sets another: asked for only where a motion has it."""
        self.asked.initial[kind].setdefault(name.casefold(), name)
        return self.of(kind).get(name.casefold()) or self._missing(kind, name)

    def of(self, kind: Kind) -> Mapping[str, Frame]:
        """Tools or objects."""
        return self.tools if kind == "tool" else self.objects

    def _found(self, kind: Kind, name: str, stated: Transform | None) -> Frame:
        found = self.held(kind, name)
        if found is None:
            return self._missing(kind, name) if stated is None else Frame.of(stated, name)
        return found if stated is None else replace(found, controller=stated, name=name)

    def _missing(self, kind: Kind, name: str) -> Frame:
        return Frame.missing(f'{kind} "{name}" is not in the program; give it in a file of --frames', name)


def written_out(word: str, distinct: Iterable[Written]) -> dict[Written, str]:
    """Names of tools or objects that a program writes out in numbers, in the order of the text.

    The word itself, or with a number from 1 where several differ.
    """
    different = list(dict.fromkeys(distinct))
    if len(different) == 1:
        return {different[0]: word}
    return {one: f"{word} {number}" for number, one in enumerate(different, 1)}


def name_at_start(word: str, *, written: bool) -> str:
    """The name of what holds until a program sets another: with 0 where the word is of one written out."""
    return f"{word} 0" if written else word


def _folded(
    kind: Kind, entries: Mapping[str, FrameEntry], where: str
) -> Iterator[tuple[str, str, FrameEntry]]:
    """Each entry of a kind with its name as it is compared and as it is written.

    Raises:
        InputError: If two names are compared as the same.
    """
    seen: dict[str, str] = {}
    for name, entry in entries.items():
        other = seen.setdefault(name.casefold(), name)
        if other != name:
            raise InputError(
                f'it has both "{kind}.{other}" and "{kind}.{name}"',
                where=where,
                rule="Names are compared with case ignored",
                way_out="Keep one of them",
            )
        yield name.casefold(), name, entry


def _frame(name: str, entry: FrameEntry, unit_m: float) -> Frame:
    true = entry.transform(unit_m)
    controller = true if entry.controller is None else entry.controller.transform(unit_m)
    return Frame(true, controller, name, taught=entry.identified is not None, covariance=entry.covariance)
