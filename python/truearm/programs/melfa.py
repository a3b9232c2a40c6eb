"""Mitsubishi MELFA-BASIC IV and V, .prg: numbered lines, and behind them the positions and joints.

Positions are (X, Y, Z, A, B, C, L1, L2)(FL1, FL2): mm and deg of the rotation Rz(C) Ry(B) Rx(A), additional
axes, and structure flags. Joints are in deg; an arm with five of them leaves the fourth slot empty. Source:
Mitsubishi Electric, CR750/CR751 and CR800 instruction manuals, "Detailed explanations of functions and
operations".
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from truearm.programs.branches import Branches
from truearm.programs.frames import Frames
from truearm.programs.layouts import Joints
from truearm.programs.melfa_configuration import StructureFlags
from truearm.programs.melfa_reader import Reader
from truearm.programs.melfa_steps import inserted
from truearm.programs.melfa_text import lines
from truearm.programs.melfa_variables import FLAGGED
from truearm.programs.program import BlendsShortened, LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.robot import Robot

_NUMBERED: Final = re.compile(r"[ \t]*(\d{1,9})[ \t]+.*")
LONGEST: Final = 127
"""Characters of a line that controllers take."""
LONGER_NUMBER: Final = 4
"""By how many digits a line grows at the most that is numbered anew."""


class MelfaBasic(BlendsShortened):
    """The language of Mitsubishi's controllers."""

    name = "MELFA BASIC"
    endings = (".prg", ".mb4", ".mb5")
    maker = "Mitsubishi"
    controller_differs = ""

    def companions(self, path: Path) -> tuple[Path, ...]:
        """None: positions are in the program."""
        return ()

    def read(self, sources: Sequence[Source], robot: Robot, frames: Frames) -> Program:
        """As in Language."""
        reader = Reader(sources[0], robot, frames)
        layouts = (Joints.of(robot.joints), FLAGGED)
        return reader.found.program(self, layouts, lambda: StructureFlags(Branches.of(robot)))

    def mark(self, source: Source, text: str) -> tuple[int, str]:
        """A remark: a line of its own before the first one; where lines are numbered and there is no number
        for it, behind the first line that does not become too long.
        """
        found = [(at, one) for at, line in lines(source) if (one := _NUMBERED.fullmatch(line)) is not None]
        if not found or found[0][0] != source.first:
            return source.first, f"' {text}{source.newline}"
        numbers = [int(one.group(1)) for _, one in found]
        if numbers[0] > 1 and numbers[0] - 1 not in numbers:
            return source.first, f"{numbers[0] - 1} ' {text}{source.newline}"
        added = f" ' {text}"
        room = LONGEST - LONGER_NUMBER - len(added)
        ends = [(len(one.group()), at) for at, one in found]
        length, at = next((end for end in ends if end[0] <= room), min(ends))
        return at + length, added

    def linear_steps(self, program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
        """A Mvs to a variable of its own for each; lines are numbered anew where there is no number left."""
        return inserted(program, moves)
