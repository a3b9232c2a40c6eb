"""The work on one arm of the fleet, wherever it is done: calibrate, compare with the last time, report."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from truearm.calibrating import calibrate
from truearm.calibration import Calibration
from truearm.doubts.outliers import Outliers, judged_means_mm
from truearm.doubts.points_together import points_together
from truearm.fits.options import CalibrationOptions
from truearm.fleet.doubted import grave_notices, undecided_notice
from truearm.fleet.drift import check_comparable, drift_of
from truearm.measurements import Measurements
from truearm.reporting.report import report
from truearm.robot import Robot
from truearm.storage.summary import distance_at_floor_mm


@dataclass(frozen=True, eq=False)
class ArmTask:
    """What is to be done; sent by value, so that workers need none of the files.

    Attributes:
        robot: The nominal arm, as Robot.to_dict gives it.
        data: What was measured.
        options: How to calibrate.
        previous: Bytes of the last calibration; None where there is none.
        previous_name: What it is called in messages.
        strip: Whether to leave the measurements out of the calibration.
        with_report: Whether to write a report.
    """

    robot: Mapping[str, Any]
    data: Measurements
    options: CalibrationOptions
    previous: bytes | None
    previous_name: str
    strip: bool
    with_report: bool


@dataclass(frozen=True, eq=False)
class ArmMade:
    """What was made of it.

    Attributes:
        calibration: Bytes of the calibration file.
        summary: Content of summary.json.
        model: Name of the model that predicts.
        means_mm: Mean errors of the models on held-out rows, without outliers where these are known.
        floor_mm: Mean error that noise alone would leave.
        errors_of: What errors in mm are of: "position" or "distance".
        drift: What changed since the last calibration; None where there is none.
        grave: The notices that need attention.
        undecided: The notice that so few poses do not tell whether it helps; empty without.
        files: The files of its measurements.
        report: The page; None where it was not asked for.
    """

    calibration: bytes
    summary: dict[str, Any]
    model: str
    means_mm: dict[str, float]
    floor_mm: float
    errors_of: str
    drift: dict[str, Any] | None
    grave: list[str]
    undecided: str
    files: list[str]
    report: str | None


def calibrate_arm(task: ArmTask) -> ArmMade:
    """Calibrate an arm of the fleet.

    Raises:
        TruearmError: As calibrate, and if the last calibration is none of this arm.
    """
    robot = Robot.from_dict(task.robot)
    previous = None
    if task.previous is not None:
        previous = Calibration.from_bytes(task.previous, where=task.previous_name)
        check_comparable(previous, robot, task.options.frame, task.previous_name)
    made = calibrate(robot, task.data, task.options)
    poses, _ = points_together(task.data.deduplicated())
    return ArmMade(
        calibration=made.to_bytes(with_rows=not task.strip),
        summary=made.summary,
        model=made.model_name,
        means_mm=judged_means_mm(made.validation, Outliers.of(made)),
        floor_mm=distance_at_floor_mm(made),
        errors_of=made.selection.errors_of,
        drift=None if previous is None else drift_of(previous, made, poses),
        grave=grave_notices(made),
        undecided=undecided_notice(made),
        files=task.data.files,
        report=report(made).html if task.with_report else None,
    )
