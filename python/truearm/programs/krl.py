"""KUKA KRL: a .src with its .dat."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from truearm.programs.frames import Frames
from truearm.programs.krl_reading import KrlReading
from truearm.programs.krl_steps import inserted
from truearm.programs.krl_storage import lines
from truearm.programs.program import BlendsShortened, LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.robot import Robot

ENDINGS: Final = (".src", ".dat")
MODULE: Final = re.compile(r"(?:global[ \t]+)?(?:def|deffct|defdat)[ \t]")


class KRL(BlendsShortened):
    """KUKA Robot Language, KSS 5 and later."""

    name = "KRL"
    endings = ENDINGS
    maker = "KUKA"
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
        for start, end in lines(source):
            first = source.text[start:end].lstrip().lower()
            if MODULE.match(first):
                ended = source.text[start:end].endswith(("\n", "\r"))
                return end, comment if ended else source.newline + comment
            if first and not first.startswith(("&", ";")):
                return start, comment
        return source.first, comment

    def linear_steps(self, program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
        """A LIN or SLIN to a written-out pose for each, blended, where nothing but the target is repeated."""
        return inserted(program, moves)
