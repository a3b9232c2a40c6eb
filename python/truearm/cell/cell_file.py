"""The cell file: which arm, which devices at which ports, and how to measure."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, field_validator

from truearm._core import Chain
from truearm.cell.drivers import ROBOTS, SENSORS, driver_and_settings
from truearm.cell.protocols import Robot, Sensor
from truearm.cell.run_up import RunUp
from truearm.cell.schema import NotNegative, Positive, Quaternion, Section, Share, Vector3, checked
from truearm.defaults import LINK_RADIUS_MM
from truearm.errors import InputError, TruearmError
from truearm.files import parsed, read_text
from truearm.planning.accessibility import AboveFloor, Rule
from truearm.robot import Robot as Arm
from truearm.rotations import UNIT_TOLERANCE, rotation_onto, transform_from_parts
from truearm.types import Floats
from truearm.units import to_si

Seen = Callable[[Floats], tuple[Floats, Floats]]


class WorldSection(Section):
    """Where the base of the robot stands in the sensor's frame, as well as it is known beforehand."""

    xyz_mm: Vector3
    quaternion_wxyz: Quaternion = (1.0, 0.0, 0.0, 0.0)
    uncertain_mm: Positive = 10.0
    uncertain_deg: Positive = 1.0

    @field_validator("quaternion_wxyz")
    @classmethod
    def _unit(cls, value: Quaternion) -> Quaternion:
        length = float(np.linalg.norm(value))
        if abs(length - 1.0) > UNIT_TOLERANCE:
            raise ValueError(f"length {length:.6g}, must be 1 (order w, x, y, z)")
        return value

    def transform(self) -> Floats:
        """world_from_base (4, 4), m."""
        return transform_from_parts(to_si(np.array(self.xyz_mm), "mm"), self.quaternion_wxyz)


class TargetSection(Section):
    """The measured point on the tool."""

    in_flange_mm: Vector3


class ClearanceSection(Section):
    """Sizes that keep the arm's links and the table's arm apart, and where the floor is."""

    link_radius_mm: NotNegative = LINK_RADIUS_MM
    column_radius_mm: Positive = 15.0
    column_mm: Positive = 600.0
    margin_mm: Positive = 10.0
    floor_mm: float | None = None

    def rules(self) -> list[Rule]:
        """That arm and tool stay above the floor, if it is stated where that is."""
        return [] if self.floor_mm is None else [AboveFloor(to_si(self.floor_mm, "mm"))]


class ProcessSection(Section):
    """How to measure."""

    contacts: Annotated[int, Field(ge=1, le=10)] = 2
    attempts: Annotated[int, Field(ge=1, le=50)] = 8
    recoveries: Annotated[int, Field(ge=0)] = 5
    recovery_s: NotNegative = 2.0
    agree_mm: Positive = 0.4
    suspicious: Positive = 5.0
    expected_mm: Positive = 4.0
    registration_poses: Annotated[int, Field(ge=4)] = 8
    registration_mm: Positive = 3.0
    check_every: Annotated[int, Field(ge=0)] = 50
    drift_mm: Positive = 0.4
    approach_deg: Positive = 3.0
    approach_mm: Positive = 3.0
    together: bool = True
    stretch: Annotated[int, Field(ge=0)] = 20
    model: Literal["constant", "variable"] = "variable"
    target_mm: Positive | None = None
    seconds_per_pose: Positive = 5.0

    def run_up(self, arm: Arm) -> RunUp:
        """How far beside a pose the joints of an arm start."""
        return RunUp(arm, self.approach_deg, self.approach_mm)


class FaultsSection(Section):
    """Share of the messages, or of the contacts, at which a virtual device fails."""

    lost: Share = 0.0
    delayed: Share = 0.0
    duplicated: Share = 0.0
    garbled: Share = 0.0
    missed: Share = 0.0
    outlier: Share = 0.0
    restart: Share = 0.0
    emergency_stop: Share = 0.0
    drift_mm_per_contact: float = 0.0
    delay_s: Positive = 2.0
    restart_s: Positive = 5.0
    outlier_mm: Positive = 5.0


class SimulateSection(Section):
    """The virtual cell that stands in for the real one."""

    seed: int = 0
    speed: Positive = 1.0
    arm: dict[str, Any] | None = None
    frame_error_mm: NotNegative = 4.0
    frame_error_deg: NotNegative = 0.3
    table_mm: NotNegative = 0.02
    panel_mm: NotNegative = 0.05
    tracker_mm: NotNegative = 0.02
    servo_lag_s: NotNegative = 0.05
    answer: str | None = None
    repeatable: bool = False
    faults: FaultsSection = FaultsSection()


class CellFile(Section):
    """A cell file as written."""

    name: Annotated[str, Field(min_length=1)]
    arm: Annotated[str, Field(min_length=1)]
    robot: dict[str, Any]
    sensor: dict[str, Any]
    world: WorldSection | None = None
    target: TargetSection | None = None
    process: ProcessSection = ProcessSection()
    clearance: ClearanceSection = ClearanceSection()
    simulate: SimulateSection = SimulateSection()


@dataclass(frozen=True, eq=False)
class Cell:
    """A cell: its file, the nominal arm, and the devices, not yet connected.

    Attributes:
        file: The cell file.
        arm: The nominal arm.
        flange_from_target: Transform (4, 4) to the measured point; turned like the file's tool.
        robot: Driver of the robot.
        sensor: Driver of the sensor.
        robot_settings: Section of the robot.
        sensor_settings: Section of the sensor.
    """

    file: CellFile
    arm: Arm
    flange_from_target: Floats
    robot: Robot
    sensor: Sensor
    robot_settings: BaseModel
    sensor_settings: BaseModel

    @classmethod
    def load(cls, path: str | Path) -> "Cell":
        """Read a cell file; files that it names are looked for beside it.

        Raises:
            InputError: If it is no TOML, a key is unknown or missing, or a value breaks its rule.
        """
        return cls.from_toml(read_text(Path(path)), where=str(path), folder=Path(path).parent)

    @classmethod
    def from_toml(cls, text: str, *, where: str = "cell", folder: Path = Path()) -> "Cell":
        """A cell from the text of its file.

        Raises:
            InputError: As for load.
        """
        file = checked(CellFile, parsed(text, where=where), where=where)
        arm = _arm(file, folder)
        robot, robot_settings = driver_and_settings(
            file.robot, ROBOTS, where=f"{where}, robot", folder=folder
        )
        sensor_section = _beside(file.sensor, folder)
        sensor, sensor_settings = driver_and_settings(
            sensor_section, SENSORS, where=f"{where}, sensor", folder=folder
        )
        target = arm.tool.copy()
        if file.target is not None:
            target[:3, 3] = to_si(np.array(file.target.in_flange_mm), "mm")
        built = _built(robot, robot_settings, arm, where), _built(sensor, sensor_settings, arm, where)
        return cls(file, arm, target, *built, robot_settings, sensor_settings)

    def targets_in_base(self, readings: Floats) -> Floats:
        """Nominal points of the target (n, 3) in the base frame, m, of readings (n, N)."""
        return np.asarray((self._flange(readings) @ self.flange_from_target)[:, :3, 3])

    def beside(self, readings: Floats, side: int) -> Floats:
        """Where joints start that are to come to readings from one side, within the limits.

        Args:
            readings: Where they are to come to (N,).
            side: 1 from lower readings, -1 from higher ones.
        """
        return self.run_up.beside(readings, side)

    @property
    def run_up(self) -> RunUp:
        """How far beside a pose joints start that are to come from one side."""
        return self.file.process.run_up(self.arm)

    def target_seen_from(self, frame_from_base: Floats) -> Seen:
        """What gives the nominal target (3,), m, and the direction of the tool there (3,), of readings (N,).

        Both are in a frame with the base at `frame_from_base` (4, 4). The direction is that from flange to
        target, or the flange's z where they coincide. Readings are taken as they are.
        """
        arm, lever = self.arm, self.flange_from_target[:3, 3]
        flange_from_pin, length = np.eye(4), math.hypot(*lever)
        flange_from_pin[:3, 3] = lever
        if length > 0.0:
            flange_from_pin[:3, :3] = rotation_onto(lever / length)
        base, end = frame_from_base @ arm.base, arm.flange @ flange_from_pin
        chain = Chain(arm.convention, list(arm.joints), arm.table, base, end)

        def seen(readings: Floats) -> tuple[Floats, Floats]:
            pose = chain.pose(arm.values_of(readings[None]))[0]
            return pose[:3, 3], pose[:3, 2]

        return seen

    def _flange(self, readings: Floats) -> Floats:
        return self.arm.flange_chain.pose(self.arm.joints_from_readings(readings))


def _built(driver: Any, settings: BaseModel, arm: Arm, where: str) -> Any:  # noqa: ANN401 - of a user's own
    try:
        return driver(settings, arm)
    except TruearmError as error:
        raise error.at(where) from None
    except Exception as error:
        raise InputError(
            f"{driver.__name__} cannot be made: {type(error).__name__}: {error}",
            where=where,
            rule="A driver is made of its Settings and the arm",
        ) from error


def _arm(file: CellFile, folder: Path) -> Arm:
    beside = folder / file.arm
    return Arm.load(beside if beside.is_file() else file.arm)


def _beside(section: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The section with its recording looked for beside the cell file."""
    content = dict(section)
    if isinstance(content.get("file"), str):
        content["file"] = str(folder / content["file"])
    return content
