"""The tool and the base that are active in a KRL program, and where they are told."""

import re
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from truearm.programs.environment import Frame, Transform
from truearm.programs.frames import Frames, name_at_start, written_out
from truearm.programs.krl_storage import KrlStorage
from truearm.programs.krl_values import Named, Operands, Structure
from truearm.programs.source import Source

REMOTE: Final = "the workpiece is on the arm and the tool stands still (#TCP)"
CALLED: Final = "a subroutine was called since it was set, and may have set another"
DIFFERS: Final = "it is not the same on all ways to this motion"
KINDS: Final = {"tool": "TOOL_DATA", "base": "BASE_DATA"}


@dataclass(frozen=True, eq=False)
class Modal:
    """What stays until it is changed.

    Attributes:
        tool: flange_from_tool.
        base: base_from_object, in the arm's own base.
        remote: Why nothing can be changed with it.
        load_kg: Mass of $LOAD, if the program says it.
    """

    tool: Frame
    base: Frame
    remote: str = ""
    load_kg: float | None = None

    def same(self, other: "Modal") -> bool:
        """Whether nothing differs."""
        mine = (self.tool.key, self.base.key, self.remote, self.load_kg)
        return mine == (other.tool.key, other.base.key, other.remote, other.load_kg)

    def joined(self, other: "Modal") -> "Modal":
        """What is known where two branches meet."""
        return Modal(
            self.tool if self.tool.key == other.tool.key else Frame.missing(f"tool: {DIFFERS}"),
            self.base if self.base.key == other.base.key else Frame.missing(f"base: {DIFFERS}"),
            self.remote or other.remote,
            self.load_kg if self.load_kg == other.load_kg else None,
        )

    def lost(self, why: str) -> "Modal":
        """The state where neither tool nor base is known any more."""
        return replace(self, tool=Frame.missing(f"tool: {why}"), base=Frame.missing(f"base: {why}"))

    def set(self, kind: str, frame: Frame) -> "Modal":
        """The state with another "tool" or "base"."""
        return replace(self, tool=frame) if kind == "tool" else replace(self, base=frame)


def remote(mode: str) -> str:
    """Why nothing can be changed in an interpolation mode; empty for #BASE."""
    return REMOTE if mode.lower() in {"#tcp", "tcp"} else ""


class KrlFrames:
    """Looks tools and bases up in the program and in the frames file."""

    def __init__(self, storage: KrlStorage, frames: Frames, sources: tuple[Source, ...]) -> None:
        self._storage, self._frames, self._sources = storage, frames, sources
        self._world = frames.held("object", "$WORLD") or Frame.of(np.eye(4), "$WORLD")
        self._written = {kind: self._names_of_written(kind) for kind in KINDS}

    def _names_of_written(self, kind: str) -> dict[bytes, str]:
        """Names of tools or bases that are written out, by their numbers."""
        stored = self._storage.values.get(f"${kind}", [])
        stated = [value.transform() for _, value in stored if value is not None]
        return written_out(f"${kind.upper()}", (one.tobytes() for one in stated if one is not None))

    def start(self) -> Modal:
        """The state at the start: what the frames file calls $TOOL and $BASE, or $TOOL 0 and $BASE 0.

        What the program assigns to them holds from there on only.
        """
        tool, base = (name_at_start(f"${kind.upper()}", written=bool(self._written[kind])) for kind in KINDS)
        placed = self._placed("base", self._frames.at_start("object", base))
        return Modal(self._frames.at_start("tool", tool), placed)

    def payload_kg(self, state: Modal) -> float | None:
        """The mass that the program, or the frames file, states."""
        if state.load_kg is not None:
            return state.load_kg
        return self._frames.payloads_kg.get(state.tool.name.casefold())

    def numbered(self, kind: str, number: str) -> Frame:
        """Tool or base of a number, as inline forms name them; 0 is the null frame."""
        if number == "0":
            return self._placed(kind, Frame.of(np.eye(4)))
        return self.named(kind, f"{KINDS[kind]}[{number}]")

    def named(self, kind: str, name: str) -> Frame:
        """A tool or base by the name that the controller knows it by."""
        stored = self._storage.values.get(name.lower(), [])
        value = stored[0][1] if len(stored) == 1 else None
        stated = None if value is None else value.transform()
        known = self._frames.of("tool" if kind == "tool" else "object")
        number = re.search(r"\[(\d+)\]", name)
        if number is not None and name.casefold() not in known and number.group(1) in known:
            name = number.group(1)
        if stored and stated is None:
            return Frame.missing(f"{kind} {name} is assigned more than once, or at run time", name)
        return self._looked_up(kind, name, stated)

    def _looked_up(self, kind: str, name: str, stated: Transform | None) -> Frame:
        if kind == "tool":
            return self._frames.tool(name, stated)
        return self._placed(kind, self._frames.work_object(name, stated))

    def of_inline_form(self, state: Modal, name: str) -> Modal:
        """The state with tool, base and interpolation mode of an inline form's frame data."""
        file, value = self._storage.only(name)
        if value is None:
            return state.lost(f"{name.upper() or 'FDAT_ACT'} does not tell it in this program")
        numbers = {part: value.numbers.get(f"{part}_no") for part in ("tool", "base")}
        for kind, number in numbers.items():
            text = "?" if number is None else f"{number.value:.0f}"
            state = state.set(kind, self.numbered(kind, text))
        text = self._sources[file].text[value.at : value.end].lower()
        return replace(state, remote=remote("#tcp" if re.search(r"ipo_frame\s*#tcp", text) else ""))

    def evaluated(self, kind: str, found: Operands | None) -> Frame:
        """A tool or base from operands joined by the geometric operator."""
        if found is None:
            return Frame.missing(f"{kind}: it is computed at run time")
        if len(found) == 1 and isinstance(found[0], Structure):
            stated = found[0].transform()
            name = "" if stated is None else self._written[kind].get(stated.tobytes(), "")
            if name:
                return self._looked_up(kind, name, stated)
        result = self.constant(kind, found[0])
        for operand in found[1:]:
            frame = self.constant("tool", operand)
            if frame.unknown or result.unknown:
                return frame if frame.unknown else result
            result = Frame(
                result.true @ frame.true,
                result.controller @ frame.controller,
                taught=result.taught or frame.taught,
            )
        return result

    def constant(self, kind: str, operand: Structure | Named) -> Frame:
        """One operand; of kind "base" it is told in the world."""
        if isinstance(operand, Structure):
            stated = operand.transform()
            if stated is None:
                return Frame.missing(f"{kind}: not all of its components are numbers")
            return self._placed(kind, Frame.of(stated))
        if operand.name in {"$nullframe", "$world"}:
            return self._placed(kind, Frame.of(np.eye(4)))
        return self.named(kind, operand.key.upper())

    def _placed(self, kind: str, frame: Frame) -> Frame:
        if kind == "tool" or frame.unknown:
            return frame
        true, controller = self._world.true @ frame.true, self._world.controller @ frame.controller
        return replace(frame, true=true, controller=controller)
