"""FANUC teach pendant programs as listings, .ls: /MN with the motions, /POS with the positions.

The syntax is that of FANUC's controllers R-30iA and R-30iB as their ASCII Program Loader writes and reads it
(HandlingTool Setup and Operations Manual, "Program instructions"; KAREL Reference Manual, CONFIG). Positions
are X Y Z in mm and W P R in deg of the rotation Rz(R) Ry(P) Rx(W), of a tool frame UT in a user frame UF, or
joint angles. J3 is read against the horizontal: the robot file's coupling knows that.
"""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

from truearm.programs.frames import Frames
from truearm.programs.layouts import Joints
from truearm.programs.program import BlendsShortened, LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.programs.tp_configuration import ConfiguredPose
from truearm.programs.tp_positions import section
from truearm.programs.tp_reader import Reader
from truearm.programs.tp_steps import inserted
from truearm.robot import Robot

LONGEST_REMARK = 30


class FanucTp(BlendsShortened):
    """The language of FANUC's teach pendants."""

    name = "FANUC TP"
    endings = (".ls",)
    maker = "FANUC"
    controller_differs = (
        "FANUC arms that were calibrated at the factory (a signature) compute with a model of their own"
    )

    def companions(self, path: Path) -> tuple[Path, ...]:
        """None: a listing holds its positions."""
        return ()

    def read(self, sources: Sequence[Source], robot: Robot, frames: Frames) -> Program:
        """As in Language."""
        reader = Reader(sources[0], robot, frames)
        layouts = (Joints.of(robot.joints), ConfiguredPose())
        return reader.found.program(self, layouts, reader.configuration)

    def mark(self, source: Source, text: str) -> tuple[int, str]:
        """Remarks before the first line of /MN, none longer than a remark may be."""
        at = section(source, "MN")[0]
        remarks = wrap(text, LONGEST_REMARK) or [""]
        return at, "".join(f"    :  !{remark} ;{source.newline}" for remark in remarks)

    def linear_steps(self, program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
        """The motion's own line to a position of its own, a copy of the target's behind all others."""
        return inserted(program, moves)
