"""The model that a controller computes with: the nominal table, or the arm's own factory kinematics."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from truearm.errors import InputError, list_names
from truearm.files import read_text
from truearm.fits.endpoints import at_tool
from truearm.inverse import Inverse
from truearm.kinds import required
from truearm.robot import URDF_ENDINGS, Robot
from truearm.types import Floats
from truearm.ur_kinematics import robot_from_conf, robot_from_yaml

NOMINAL: Final = "nominal"
YAML_ENDINGS: Final = (".yaml", ".yml")


@dataclass(frozen=True)
class Controller:
    """What turns joints into poses, and poses into joints, inside a controller.

    A program's Cartesian targets mean what this model makes of them. Which model a controller has cannot be
    seen from a program; it is declared by whoever knows the arm.

    Attributes:
        robot: A plain arm.
        kind: "nominal", or "factory" where it was read from a file of the very arm.
        source: File it was read from; empty for the nominal one.
    """

    robot: Robot
    kind: Literal["nominal", "factory"] = "nominal"
    source: str = ""

    def __post_init__(self) -> None:
        required(self.robot, Robot, "the robot")

    @classmethod
    def nominal(cls, robot: Robot) -> "Controller":
        """A controller that computes with the nominal table."""
        return cls(robot)

    @classmethod
    def load(cls, path: str | Path, *, robot: Robot | None = None) -> "Controller":
        """The factory kinematics of an arm, from a file.

        Args:
            path: A robot file (TOML), a URDF ("arm.urdf#tool0"), a kinematics YAML of Universal Robots' ROS
                driver, or the calibration.conf of a UR controller.
            robot: The nominal arm: needed by calibration.conf, which holds differences to it; its limits, its
                tool and its name are taken where the file has none, and its number of joints is checked.

        Raises:
            InputError: If there is no such file, it is none of these, or it is of another kind of arm.
        """
        given = str(path)
        if robot is not None:
            required(robot, Robot, "the robot")
        found = _read(Path(given.partition("#")[0]), given, robot)
        if robot is not None and found.joints != robot.joints:
            raise InputError(
                f"it has {_words(found)}",
                where=given,
                rule=f"The arm, {robot.name}, has {_words(robot)}",
                way_out="Name the controller's file of this arm",
            )
        return cls(found, "factory", given)

    @classmethod
    def declared(cls, declaration: str | Path, robot: Robot) -> "Controller":
        """The controller that `--controller nominal|FILE` declares for an arm.

        Raises:
            InputError: As :meth:`load`.
        """
        return cls.nominal(robot) if str(declaration) == NOMINAL else cls.load(declaration, robot=robot)

    @cached_property
    def inverse(self) -> Inverse:
        """All inverse kinematics of this model."""
        return Inverse(self.robot)

    def pose(self, q: ArrayLike, tool: ArrayLike | None = None) -> Floats:
        """base_from_tool as the controller computes it: (n, 4, 4) for readings (n, N), (4, 4) for (N,).

        Args:
            q: Readings.
            tool: flange_from_tool (4, 4), or a point (3,); the flange itself by default.

        Raises:
            InputError: If readings or tool are not finite numbers of these shapes.
        """
        flange_tool = np.eye(4) if tool is None else at_tool(self.robot, tool)
        values = np.atleast_2d(self.robot.joints_from_readings(q))
        poses = self.robot.flange_chain.pose(np.ascontiguousarray(values)) @ flange_tool
        return poses[0] if np.ndim(q) == 1 else poses


def _read(path: Path, given: str, robot: Robot | None) -> Robot:
    ending = path.suffix.lower()
    if ending in YAML_ENDINGS:
        return robot_from_yaml(read_text(path), where=given, nominal=robot)
    if ending == ".conf":
        return robot_from_conf(read_text(path), where=given, nominal=robot)
    if ending == ".toml" or ending in URDF_ENDINGS:
        return Robot.load(given)
    raise InputError(
        f'a file that ends in "{path.suffix}" is no model of a controller',
        where=given,
        rule=f"Known are a robot file or URDF ({list_names(['.toml', *URDF_ENDINGS])}), UR's kinematics "
        f"({list_names(YAML_ENDINGS)}) and UR's calibration.conf; {NOMINAL} is declared by its name",
    )


def _words(robot: Robot) -> str:
    kinds = [
        f"{robot.joints.count(kind)} {kind}" for kind in ("revolute", "prismatic") if kind in robot.joints
    ]
    return f"{' and '.join(kinds)} joints"
