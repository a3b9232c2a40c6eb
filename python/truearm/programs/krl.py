"""KUKA KRL: a .src with its .dat."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from truearm.programs.frames import Frames
from truearm.programs.krl_reading import KrlReading
from truearm.programs.layouts import DECIMALS_DEG, DECIMALS_MM
from truearm.programs.program import LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.programs.stepping import lines_before
from truearm.robot import Robot

ENDINGS: Final = (".src", ".dat")


class KRL:
    """KUKA Robot Language, KSS 5 and later."""

    name = "KRL"
    endings = ENDINGS
    controller_differs = (
        "KUKA arms with an accuracy option (absolutely accurate robot) compute with a model of their own"
    )

    def companions(self, path: Path) -> tuple[Path, ...]:
        """The .dat beside a .src, or the other way round; case is ignored."""
        wanted = {".src": ".dat", ".dat": ".src"}.get(path.suffix.lower())
        if wanted is None or not path.parent.is_dir():
            return ()
        return tuple(
            sorted(
                file
                for file in path.parent.iterdir()
                if file.stem.lower() == path.stem.lower() and file.suffix.lower() == wanted
            )
        )[:1]

    def read(self, sources: Sequence[Source], robot: Robot, frames: Frames) -> Program:
        """As in Language."""
        return KrlReading(self, tuple(sources), robot, frames).program()

    def mark(self, source: Source, text: str) -> tuple[int, str]:
        """Behind the line that begins the module, so that the header stays the header."""
        comment = f";{text}{source.newline}"
        for line, start in enumerate(source.line_starts, start=1):
            first = source.line_text(line).lstrip().lower()
            if first.startswith(("def ", "deffct ", "defdat ", "global def")):
                following = source.line_starts[line : line + 1]
                return (following[0], comment) if following else (len(source.text), source.newline + comment)
            if first and not first.startswith(("&", ";")):
                return start, comment
        return 0, comment

    def linear_steps(self, program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
        """A LIN to a written-out pose for each, passed with C_DIS; none within an inline form."""
        return lines_before(program, moves, self._step)

    @staticmethod
    def _step(program: Program, step: LinearStep) -> str | None:
        source = program.sources[step.file]
        line = source.line_text(step.line)
        word = line.split(maxsplit=1)[0].upper()
        if word not in {"LIN", "SLIN"} or _in_fold(source, step.line):
            return None
        indent = line[: len(line) - len(line.lstrip())]
        parts = ",".join(
            f"{name} {value:.{max(decimals, least)}f}"
            for name, value, decimals, least in zip(
                "XYZABC",
                step.values[:6],
                step.decimals[:6],
                (DECIMALS_MM,) * 3 + (DECIMALS_DEG,) * 3,
                strict=True,
            )
        )
        return f"{indent}{word} {{{parts}}} C_DIS{source.newline}"


def _in_fold(source: Source, line: int) -> bool:
    """Whether a line is part of an inline form: the last fold mark before it opens a motion."""
    for number in range(line - 1, 0, -1):
        text = source.line_text(number).lstrip().lower()
        if text.startswith(";endfold"):
            return False
        if text.startswith(";fold"):
            return text[5:].lstrip().startswith(("lin", "slin", "ptp", "sptp"))
    return False
