"""Universal Robots URScript, .script: joint angles in rad, poses p[x, y, z, rx, ry, rz] in m and rad.

The syntax and the functions are those of Universal Robots' Script Manual. Poses are of the active TCP in the
frame of the base. A program has no configuration data: the controller takes the solution that is nearest to
where the arm stands, or to `qnear`.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from truearm.errors import InputError
from truearm.programs.declaring import UNIVERSAL
from truearm.programs.frames import Frames
from truearm.programs.layouts import Joints, RotationVectorPose
from truearm.programs.program import LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.programs.urscript_constants import AXES
from truearm.programs.urscript_reader import Reader
from truearm.programs.urscript_steps import blends, inserted
from truearm.robot import Robot


class UrScript:
    """The language of Universal Robots' controllers."""

    name = "URScript"
    endings = (".script", ".urscript")
    maker = "Universal Robots"
    controller_differs = UNIVERSAL

    def companions(self, path: Path) -> tuple[Path, ...]:
        """None: a program is one file."""
        return ()

    def read(self, sources: Sequence[Source], robot: Robot, frames: Frames) -> Program:
        """As in Language."""
        source = sources[0]
        if robot.joints != ("revolute",) * AXES:
            raise InputError(
                f"{robot.name} has {robot.joint_count} joints",
                where=str(source.path),
                rule="A URScript program is of an arm with six revolute ones",
            )
        reader = Reader(source, frames)
        layouts = (Joints.of(robot.joints, degrees=False), RotationVectorPose())
        targets, moves = reader.tables()
        return replace(reader.found.program(self, layouts), targets=targets, moves=moves)

    def mark(self, source: Source, text: str) -> tuple[int, str]:
        """A comment before the first line."""
        return source.first, f"# {text}{source.newline}"

    def blends(self, program: Program, move: int) -> tuple[float, float] | None:
        """The blend radii that the motions state."""
        return blends(program, move)

    def linear_steps(self, program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
        """The motion's own line with the step in place of its target; none if it states a time."""
        return inserted(program, moves)
