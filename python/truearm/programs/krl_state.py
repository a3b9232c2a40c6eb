"""The tool and the base that are active in a KRL program, and where they are told."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from truearm.programs.environment import Frame
from truearm.programs.frames import KRL_WORLD, Frames, name_at_start, written_out
from truearm.programs.krl_order import Order
from truearm.programs.krl_orientation import (
    HEEDED,
    HEEDING,
    LINE_DATA,
    USUAL,
    VAR,
    Mentioned,
    Orientation,
    mode_in,
    mode_of,
    named_in,
)
from truearm.programs.krl_routines import FRAMES, ORIENTATION, Routines
from truearm.programs.krl_storage import WORLD_SET_BY, KrlStorage
from truearm.programs.krl_values import Named, Operands, Structure
from truearm.programs.source import Source
from truearm.programs.tables import Motion
from truearm.types import Transform

REMOTE: Final = "the workpiece is on the arm and the tool stands still (#TCP)"
CALLED: Final = "a subroutine was called since it was set, and may have set another"
DIFFERS: Final = "it is not the same on all ways to this motion"
CALLERS: Final = "it is the one that the callers of this routine have set"
INTERRUPTED: Final = "an interrupt or a trigger may have set another"
JUMPED: Final = "a GOTO may come here with another"
GIVEN: Final = "is given to a subroutine, which may change it"
ROUND_AGAIN: Final = "a loop comes round to it with another tool, base or $ORI_TYPE"
KINDS: Final = {"tool": "TOOL_DATA", "base": "BASE_DATA"}
PARTS: Final = (*KINDS, "mode")


class FrameData(NamedTuple):
    """Frame data of an inline form.

    Attributes:
        name: As the program has it.
        file: Number of the file that states it.
        value: What it states; None where that is not certain.
    """

    name: str = "FDAT_ACT"
    file: int = 0
    value: Structure | None = None


NOTHING: Final = FrameData()


@dataclass(frozen=True, eq=False)
class Modal:
    """What stays until it is changed.

    Attributes:
        tool: flange_from_tool.
        base: base_from_object, in the arm's own base.
        remote: Why nothing can be changed with it.
        load_kg: Mass of $LOAD, if the program says it.
        prepared: What FDAT_ACT holds.
        orientation: Whether the orientation of targets counts.
    """

    tool: Frame
    base: Frame
    remote: str = ""
    load_kg: float | None = None
    prepared: FrameData = NOTHING
    orientation: Orientation = HEEDED

    def same(self, other: "Modal") -> bool:
        """Whether nothing differs."""
        mine, others = (
            (one.tool.key, one.base.key, one.remote, one.load_kg, one.orientation) for one in (self, other)
        )
        return mine == others

    def overruled(self, before: "Modal", again: "Modal") -> bool:
        """Whether a tool, a base or a mode that is known here, in a loop, is another one when it comes round
        again.
        """
        known = [
            (mine.key, was.key, now.key)
            for mine, was, now in ((self.tool, before.tool, again.tool), (self.base, before.base, again.base))
            if not mine.unknown
        ]
        parts = [*known, (self.remote, before.remote, again.remote)]
        return self.orientation.overruled(before.orientation, again.orientation) or any(
            mine == was != now for mine, was, now in parts
        )

    def joined(self, other: "Modal") -> "Modal":
        """What is known where two branches meet."""
        return Modal(
            self.tool if self.tool.key == other.tool.key else Frame.missing(f"tool: {DIFFERS}"),
            self.base if self.base.key == other.base.key else Frame.missing(f"base: {DIFFERS}"),
            self.remote or other.remote,
            self.load_kg if self.load_kg == other.load_kg else None,
            self.prepared if self.prepared == other.prepared else NOTHING,
            self.orientation.joined(other.orientation, DIFFERS),
        )

    def lost(self, why: str) -> "Modal":
        """The state where neither tool nor base is known any more, nor whether orientations count."""
        return self.without_frames(why).disoriented(why)

    def without_frames(self, why: str) -> "Modal":
        """The state where neither tool nor base is known any more."""
        tool, base = (Frame.missing(f"{kind}: {why}") for kind in KINDS)
        return replace(self, tool=tool, base=base, prepared=NOTHING)

    def disoriented(self, why: str) -> "Modal":
        """The state where it is not known any more whether the orientation of targets counts."""
        return replace(self, orientation=self.orientation.lost(why))

    def changed(self, subjects: Collection[str], why: str, way_out: str = "") -> "Modal":
        """The state where something may have set some of SUBJECTS; `way_out` is told of orientations."""
        if not subjects:
            return self
        state = self.without_frames(why) if FRAMES in subjects else self
        if ORIENTATION in subjects:
            return state.disoriented(why + way_out)
        orientation = state.orientation
        for mode in (mode for mode in HEEDING if mode in subjects):
            orientation = orientation.perhaps(mode, why + way_out)
        return replace(state, orientation=orientation)

    def unprepared(self) -> "Modal":
        """The state where it is not known what inline forms have prepared."""
        return replace(self, prepared=NOTHING, orientation=self.orientation.unprepared(DIFFERS))

    def along(self, motion: Motion) -> "Modal":
        """The state as far as it matters for a motion: those joint by joint always heed orientations."""
        joints = self.orientation._replace(mode=None)
        return replace(self, orientation=joints) if motion == Motion.JOINT else self

    def set(self, kind: str, frame: Frame) -> "Modal":
        """The state with another "tool" or "base"."""
        return replace(self, tool=frame) if kind == "tool" else replace(self, base=frame)


def remote(mode: str) -> str:
    """Why nothing can be changed in an interpolation mode; empty for #BASE."""
    return REMOTE if mode.lower() in {"#tcp", "tcp"} else ""


class KrlFrames:
    """Looks tools and bases up in the program and in the frames file."""

    def __init__(
        self,
        storage: KrlStorage,
        frames: Frames,
        sources: tuple[Source, ...],
        routines: Routines,
        order: Order,
    ) -> None:
        self._storage, self._frames, self._sources = storage, frames, sources
        self._routines, self._order = routines, order
        self._world = self._find_world()
        self._written = {kind: self._names_of_written(kind) for kind in KINDS}
        self.mentioned = Mentioned.of((source.text for source in sources), storage.values)

    def _find_world(self) -> Frame:
        """The world in the arm's base; not known, nor is any base, where the program may move it.

        What one run moves is moved when the next one begins: it does not matter where in the text that is.
        """
        given = (f"{name.upper()} {GIVEN}" for name in WORLD_SET_BY if name in self._routines.given)
        moved = self._storage.moved or next(given, "")
        held = self._frames.held("object", KRL_WORLD)
        return Frame.missing(f"base: {moved}") if moved else held or Frame.of(np.eye(4), KRL_WORLD)

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
        orientation = HEEDED._replace(elsewhere=self.mentioned.elsewhere)
        return Modal(self._frames.at_start("tool", tool), placed, orientation=orientation)

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
        key = name.lower()
        stored = self._storage.values.get(key, [])
        value = stored[0][1] if len(stored) == 1 else None
        stated = None if value is None else value.transform()
        known = self._frames.of("tool" if kind == "tool" else "object")
        number = re.search(r"\[(\d+)\]", name)
        if number is not None and name.casefold() not in known and number.group(1) in known:
            name = number.group(1)
        problem = self._problem(key, stated)
        if problem:
            return Frame.missing(f"{kind} {name} {problem}", name)
        return self._looked_up(kind, name, stated)

    def _problem(self, key: str, stated: Transform | None) -> str:
        """Why a tool or base of that name is not certain where the program uses it; empty if it is."""
        storage, array = self._storage, key.partition("[")[0]
        if key.endswith("[?]"):
            return "is chosen at run time"
        if (key in storage.values and stated is None) or f"{array}[?]" in storage.values:
            return "is assigned more than once, or at run time"
        if {key, array, f"{array}[?]"} & self._routines.given:
            return GIVEN
        if key in storage.values and not self._holds(key):
            return "is assigned in the program, but not certainly before it is used"
        return ""

    def _holds(self, key: str) -> bool:
        """Whether a name certainly has the value that the program assigns to it."""
        return key in self._storage.initial or self._order.assigned(key)

    def _looked_up(self, kind: str, name: str, stated: Transform | None) -> Frame:
        if kind == "tool":
            return self._frames.tool(name, stated)
        return self._placed(kind, self._frames.work_object(name, stated))

    def frame_data(self, name: str) -> FrameData:
        """The frame data of that name, as far as they are certain."""
        file, value = self._storage.only(name)
        certain = self._holds(name.lower()) and name.lower() not in self._routines.given
        return FrameData(name.upper(), file, value if certain else None)

    def of_inline_form(self, state: Modal, data: FrameData, parts: Sequence[str] = PARTS) -> Modal:
        """The state with tool, base and interpolation mode of an inline form's frame data, or with parts."""
        name, file, value = data
        for kind in (one for one in KINDS if one in parts):
            if value is None:
                missing = Frame.missing(f"{kind}: {name} does not tell it in this program")
                state = state.set(kind, missing)
                continue
            number = value.numbers.get(f"{kind}_no")
            state = state.set(kind, self.numbered(kind, "?" if number is None else f"{number.value:.0f}"))
        if value is None or "mode" not in parts:
            return state
        text = self._sources[file].text[value.at : value.end].lower()
        return replace(state, remote=remote("#tcp" if re.search(r"ipo_frame\s*#tcp", text) else ""))

    def oriented(self, state: Modal, name: str, told: str, at: tuple[int, int]) -> Modal:
        """The state behind an assignment to $ORI_TYPE or LDAT_ACT.

        Args:
            state: The state before it.
            name: Which of them.
            told: What stands behind the name, without blanks and in small letters.
            at: Where it stands: file and offset.
        """
        before, value = state.orientation, told.partition("=")[2]
        if name != LINE_DATA:
            data = named_in(value)
            found = self._by_line_data(data) if data else mode_in(value)
            after = before if found is None else before._replace(mode=found, set_at=at)
            return replace(state, orientation=after)
        if told.startswith("."):
            found = mode_in(value) if told.startswith(".ori_typ=") else None
        else:
            found = self._by_line_data(value)
        return replace(state, orientation=before if found is None else before._replace(line_data=found))

    def _by_line_data(self, told: str) -> str | None:
        """The mode of line data, by name or written out, or why it is not known; None if they have none."""
        if told == USUAL:
            return VAR
        if not told.startswith("{"):
            name, file, value = self.frame_data(told)
            if value is None:
                return f"$ORI_TYPE: {name} does not tell it in this program"
            told = self._sources[file].text[value.at : value.end].lower()
        mode = mode_of(told)
        return None if mode is None else mode_in(mode)

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
            result = replace(result.then(frame), name="")
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
        return frame if kind == "tool" else self._world.then(frame)
