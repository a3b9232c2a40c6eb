"""The frames file: tools and work objects that a program does not hold, or that were taught wrongly.

A TOML file with a table `[tool.NAME]` or `[object.NAME]` a frame; docs/reference/programs.md has all keys.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator
from scipy.spatial.transform import Rotation

from truearm.errors import InputError
from truearm.files import parsed, read_text
from truearm.programs.environment import Frame, Transform
from truearm.rotations import UNIT_TOLERANCE, transform_from_parts

Number = Annotated[float, Field(allow_inf_nan=False)]
LENGTHS_M: Final = {"mm": 1e-3, "m": 1.0}
ORIENTATIONS: Final = ("quaternion_wxyz", "euler_zyx_deg", "rotation_vector_rad")


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
            transform[:3, :3] = Rotation.from_euler("ZYX", self.euler_zyx_deg, degrees=True).as_matrix()
        if self.rotation_vector_rad is not None:
            transform[:3, :3] = Rotation.from_rotvec(self.rotation_vector_rad).as_matrix()
        return transform


class FrameEntry(Placement):
    """A tool or an object: where it is, what the controller believes, and how well that is known."""

    controller: Placement | None = None
    payload_kg: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None
    identified: Mapping[str, Any] | None = None


class FramesFile(_Section):
    """The whole file."""

    format: Literal[1] = 1
    length_unit: Literal["mm", "m"] = "mm"
    tool: Mapping[str, FrameEntry] = Field(default_factory=dict)
    object: Mapping[str, FrameEntry] = Field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Frames:
    """Tools and objects by name; names are compared with case ignored.

    Attributes:
        tools: flange_from_tool of each.
        objects: base_from_object of each.
        payloads_kg: Payloads of the tools that state one.
        where: The file, for messages; empty without one.
    """

    tools: Mapping[str, Frame] = field(default_factory=dict)
    objects: Mapping[str, Frame] = field(default_factory=dict)
    payloads_kg: Mapping[str, float] = field(default_factory=dict)
    where: str = ""

    @classmethod
    def load(cls, path: str | Path) -> "Frames":
        """The frames of a file.

        Raises:
            InputError: If it cannot be read or breaks a rule; names the key.
        """
        return cls.parse(read_text(Path(path)), where=str(path))

    @classmethod
    def parse(cls, text: str, *, where: str = "frames") -> "Frames":
        """The frames of the text of a file."""
        try:
            content = FramesFile.model_validate(parsed(text, where=where))
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
            {name.casefold(): _frame(name, entry, unit) for name, entry in content.tool.items()},
            {name.casefold(): _frame(name, entry, unit) for name, entry in content.object.items()},
            {n.casefold(): e.payload_kg for n, e in content.tool.items() if e.payload_kg is not None},
            where,
        )

    def tool(self, name: str, stated: Transform | None = None) -> Frame:
        """The tool of that name; `stated` is what the program says, if it says, and what the controller has.

        A tool that the program states and the file holds is aimed with as the file has it: the file's
        is where the tool truly is. One that neither has is unknown.
        """
        return self._found(self.tools, "tool", name, stated)

    def work_object(self, name: str, stated: Transform | None = None) -> Frame:
        """The work object of that name, likewise."""
        return self._found(self.objects, "object", name, stated)

    def _found(self, known: Mapping[str, Frame], kind: str, name: str, stated: Transform | None) -> Frame:
        found = known.get(name.casefold())
        if found is None:
            reason = f'{kind} "{name}" is not in the program; give it in a file of --frames'
            return Frame.of(stated, name) if stated is not None else Frame.missing(reason, name)
        return found if stated is None else Frame(found.true, stated, name)


def _frame(name: str, entry: FrameEntry, unit_m: float) -> Frame:
    true = entry.transform(unit_m)
    controller = true if entry.controller is None else entry.controller.transform(unit_m)
    return Frame(true, controller, name)
