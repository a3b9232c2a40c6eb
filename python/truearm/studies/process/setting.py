"""What section 7 of the paper states, and where the virtual cell has it: arm, table, path, regions."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import tomli_w

from truearm.cell.examples import example
from truearm.defaults import EXPERIMENT_SPEED, PAPER_POSES, PAPER_REGIONS
from truearm.errors import UsageError
from truearm.files import parsed
from truearm.planning.configurations import Configuration
from truearm.planning.spaces import CartesianSpace
from truearm.robot import Robot
from truearm.simulation import PAPER_PARAMETERS
from truearm.studies.setting import ROBOT, TEST_POINTS, straight
from truearm.types import Floats
from truearm.units import to_si

DEMANDED_MM: Final = 0.5
SECONDS_A_MEASUREMENT: Final = 5.0
ORIGIN_MM: Final = (0.0, -80.0, 0.0)
"""Below the axis of joint 1: from the origin of Table I's world the path's end is out of reach."""
PATH_MM: Final = ((-300.0, 520.0, 150.0), (350.0, 690.0, 600.0))
LOW_MM: Final = (-350.0, 500.0, 120.0)
HIGH_MM: Final = (400.0, 710.0, 630.0)
COMMAND_MM: Final = 0.1
"""The controller rounds the positions of commands to this."""
SEED: Final = 6
LENGTH_MM: Final = 1.14
ANGLE_DEG: Final = 0.143
"""The first seed, with these sizes, whose path errs by 0.3 to 2.5 mm uncalibrated, Figure 10(a), all errors
positive."""
SHARE: Final = 0.5
"""Conventional calibration leaves the paper's arm about half of its error, Figure 10(b): errors of the joints
themselves are half as large as those of geometry."""
WORLD_MM: Final = (440.0, -300.0, -75.0)
EXPECTED_MM: Final = 6.0
CHECK_EVERY: Final = 200
COORDINATES: Final = 3
FEWEST_POSES: Final = len(PAPER_PARAMETERS) // COORDINATES + 1
"""Poses whose coordinates are more than the parameters of a region."""


@dataclass(frozen=True)
class Setting:
    """How large the experiment is.

    Attributes:
        seed: Of the virtual arm, its noise and the frame.
        regions: Into which the space is divided.
        poses: Measured in each to identify its CEPs.
        tests: Further ones that judge it.
        speed: How fast the virtual clock runs.
    """

    seed: int = SEED
    regions: int = PAPER_REGIONS
    poses: int = PAPER_POSES
    tests: int = TEST_POINTS
    speed: float = EXPERIMENT_SPEED

    def __post_init__(self) -> None:
        if self.poses < FEWEST_POSES:
            raise UsageError(
                f"{self.poses} poses in each region",
                where="--poses",
                rule=f"The {len(PAPER_PARAMETERS)} parameters of a region are found from more coordinates "
                f"than that, {COORDINATES} of each pose: {FEWEST_POSES} poses at the least",
            )


def cell_text(setting: Setting) -> str:
    """The cell file: the panel looks at the robot, so that the pin meets it with joints 4 and 5 at zero."""
    content = parsed(example(ROBOT), where=ROBOT)
    content["name"] = "The paper's experiment"
    content["sensor"]["panel"] = {"normal": "-y"}
    content["world"] = {**content["world"], "xyz_mm": list(WORLD_MM)}
    content["process"] = {"expected_mm": EXPECTED_MM, "stretch": 0, "check_every": CHECK_EVERY}
    content["simulate"] = {
        "seed": setting.seed,
        "speed": setting.speed,
        "repeatable": True,
        "arm": _arm(setting.seed),
    }
    return tomli_w.dumps(content)


def space() -> CartesianSpace:
    """The measured space: around the path, elbow up, joints 4 and 5 at zero."""
    origin, low, high = (to_si(np.array(place), "mm") for place in (ORIGIN_MM, LOW_MM, HIGH_MM))
    return CartesianSpace(Robot.load(ROBOT), low, high, origin, Configuration(elbow="up"))


def path() -> Floats:
    """Coordinates (200, 3) of the path of Figure 10, m."""
    begin, end = to_si(np.array(PATH_MM), "mm")
    return straight(begin, end)


def random_paths(count: int, rng: np.random.Generator) -> list[Floats]:
    """Straight paths (200, 3) between random points of the space, m."""
    box = space()
    return [straight(*rng.uniform(box.low, box.high, (2, 3))) for _ in range(count)]


def _arm(seed: int) -> dict[str, Any]:
    wrong = {
        "length_mm": LENGTH_MM,
        "angle_deg": ANGLE_DEG,
        "share": SHARE,
        "signs": "positive",
        "non_geometric": "joint",
    }
    return {"seed": seed, "parameters": list(PAPER_PARAMETERS), "imperfections": wrong}
