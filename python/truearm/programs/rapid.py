"""ABB RAPID: a module."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from truearm.programs.frames import Frames
from truearm.programs.layouts import DECIMALS_MM, DECIMALS_QUATERNION, of_pose
from truearm.programs.program import BlendsShortened, LinearStep, Program, StepTexts
from truearm.programs.rapid_reading import RapidReading
from truearm.programs.rapid_values import arguments, statement_reader
from truearm.programs.source import Source
from truearm.programs.stepping import lines_before, target_of
from truearm.robot import Robot

MODULE: Final = re.compile(
    r"(?:^|\A\xef\xbb\xbf)[ \t]*MODULE\b[^\r\n]*(?:\r\n|\n|\r|$)", re.IGNORECASE | re.MULTILINE
)
REPEATED: Final = frozenset({"v", "z", "wobj", "tload"})
"""Optional arguments that mean the same for a part of a motion as for the whole."""
UNUSED_AXES: Final = "[9E9,9E9,9E9,9E9,9E9,9E9]"
FLY_BY: Final = "z1"


class RAPID(BlendsShortened):
    """RAPID of IRC5 and OmniCore controllers, and of older ones where they agree."""

    name = "RAPID"
    endings = (".mod", ".modx", ".sys", ".sysx")
    maker = "ABB"
    controller_differs = (
        "ABB arms with Absolute Accuracy compute with a model of their own, and a program does not say so"
    )

    def companions(self, path: Path) -> tuple[Path, ...]:
        """None: data of other modules comes from a frames file."""
        return ()

    def read(self, sources: Sequence[Source], robot: Robot, frames: Frames) -> Program:
        """As in Language."""
        return RapidReading(self, tuple(sources), robot, frames).program()

    def mark(self, source: Source, text: str) -> tuple[int, str]:
        """Behind the line that begins the module."""
        found = MODULE.search(source.text)
        return (found.end() if found else source.first), f"! {text}{source.newline}"

    def linear_steps(self, program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
        """The same instruction with a written-out target, passed in a zone.

        None if it is not on one line, or says what does not hold for a part of the way, such as its time.
        """
        return lines_before(program, moves, self._step)

    @staticmethod
    def _step(program: Program, step: LinearStep) -> str | None:
        source = program.sources[step.file]
        start = source.line_starts[step.line - 1]
        line = source.line_text(step.line)
        if not line.rstrip().endswith(";") or line.count(";") != 1 or "!" in line:
            return None
        reader = statement_reader(source, start, start + len(line))
        if reader.peek() != "movel":
            return None
        reader.take()
        given = arguments(reader.rest())
        options = {name for argument in given for name in argument.options}
        if len(given) != 4 or given[0].options or not options <= REPEATED:
            return None
        layout = program.layouts[int(program.targets.layout[target_of(program, step)])]
        if not of_pose(layout) or any(map(math.isnan, step.values)):
            return None
        target, zone = given[0].tokens, given[2].tokens
        cut = [target[0].start - start, target[-1].end - start, zone[0].start - start, zone[-1].end - start]
        passed = FLY_BY if zone[0].text.lower() == "fine" else line[cut[2] : cut[3]]
        return (
            f"{line[: cut[0]]}{_target(step)}{line[cut[1] : cut[2]]}{passed}{line[cut[3] :]}{source.newline}"
        )


def _target(step: LinearStep) -> str:
    least = [DECIMALS_MM] * 3 + [DECIMALS_QUATERNION] * 4 + [0] * 4
    parts = [
        f"{value:.{max(decimals, some)}f}"
        for value, decimals, some in zip(step.values, step.decimals, least, strict=True)
    ]
    return f"[[{','.join(parts[:3])}],[{','.join(parts[3:7])}],[{','.join(parts[7:11])}],{UNUSED_AXES}]"
