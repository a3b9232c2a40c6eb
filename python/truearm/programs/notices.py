"""What is to be known of a rewritten program's load, tools and frames file."""

from typing import Final

from truearm.errors import Notice, list_names
from truearm.programs.frames import Frames, Kind
from truearm.programs.program import Program
from truearm.robot import Robot

SAME_PAYLOAD_KG: Final = 0.05
IN_WORDS: Final[dict[Kind, str]] = {"tool": "tool", "object": "work object"}


def payload_notices(program: Program, robot: Robot) -> list[Notice]:
    """What differs between the payload that was calibrated with and those that the program states."""
    stated = sorted({e.payload_kg for e in program.environments if e.payload_kg is not None})
    if robot.payload is None or not stated:
        return []
    calibrated = robot.payload.mass_kg
    others = [mass for mass in stated if abs(mass - calibrated) > SAME_PAYLOAD_KG]
    if not others:
        return []
    masses = ", ".join(f"{mass:g} kg" for mass in others)
    return [
        Notice(
            "payload",
            f"the program states a payload of {masses}, the calibration was made with {calibrated:g} kg: "
            "what the arm yields under the difference is not corrected",
        )
    ]


def frames_notices(program: Program, frames: Frames) -> list[Notice]:
    """Entries of the frames file that no tool or work object of the program has the name of."""
    return [notice for kind in IN_WORDS if (notice := _unasked(program, frames, kind)) is not None]


def _unasked(program: Program, frames: Frames, kind: Kind) -> Notice | None:
    frame_of = "tool" if kind == "tool" else "work_object"
    had = {getattr(environment, frame_of).name.casefold() for environment in program.environments}
    initial = {folded: name for folded, name in frames.asked.initial[kind].items() if folded in had}
    names = frames.asked.names[kind] | initial
    left = [entry.name for folded, entry in frames.of(kind).items() if folded not in names]
    if not left:
        return None
    noun = IN_WORDS[kind]
    several = "s" if len(left) > 1 else ""
    own = f"its {noun}s are {list_names(names.values())} there" if names else f"it asks for no {noun} there"
    return Notice(
        "frames",
        f"{noun}{several} {list_names(left)} of {frames.where} {'change' if several else 'changes'} nothing: "
        f"the program has none of that name, {own}",
    )
