"""truearm: robot arm calibration with Denavit-Hartenberg parameters that vary over the workspace.

    import truearm as ta

    robot = ta.Robot.load("ur10")
    data = ta.Measurements.read_csv("ur10.csv")
    calibration = ta.calibrate(robot, data)

What is public is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from truearm.calibrating import calibrate
    from truearm.calibration import Calibration
    from truearm.compensation import Compensated, Compensator, Refusal
    from truearm.controller import Controller
    from truearm.errors import InputError, Notice, TruearmError, UsageError, WorkError
    from truearm.evaluation import Evaluation, EvaluationOptions, evaluate
    from truearm.fits.options import CalibrationOptions
    from truearm.limits import Limits
    from truearm.measurements import Measurements
    from truearm.programs.compensating import compensate_program
    from truearm.programs.frames import Frames
    from truearm.programs.rewriting import Choices, Rewritten
    from truearm.release import __version__ as __version__
    from truearm.robot import Robot
    from truearm.rows.splitting import HoldoutRange, SplitRule
    from truearm.updating import Update, UpdateOptions, roll_back, update

__all__ = [
    "Calibration",
    "CalibrationOptions",
    "Choices",
    "Compensated",
    "Compensator",
    "Controller",
    "Evaluation",
    "EvaluationOptions",
    "Frames",
    "HoldoutRange",
    "InputError",
    "Limits",
    "Measurements",
    "Notice",
    "Refusal",
    "Rewritten",
    "Robot",
    "SplitRule",
    "TruearmError",
    "Update",
    "UpdateOptions",
    "UsageError",
    "WorkError",
    "calibrate",
    "compensate_program",
    "evaluate",
    "roll_back",
    "update",
]

_HOME: Final = {
    "__version__": "release",
    "calibrate": "calibrating",
    "Calibration": "calibration",
    "Compensated": "compensation",
    "Compensator": "compensation",
    "Controller": "controller",
    "Refusal": "compensation",
    "InputError": "errors",
    "Notice": "errors",
    "TruearmError": "errors",
    "UsageError": "errors",
    "WorkError": "errors",
    "Evaluation": "evaluation",
    "EvaluationOptions": "evaluation",
    "evaluate": "evaluation",
    "Limits": "limits",
    "Measurements": "measurements",
    "CalibrationOptions": "fits.options",
    "compensate_program": "programs.compensating",
    "Frames": "programs.frames",
    "Choices": "programs.rewriting",
    "Rewritten": "programs.rewriting",
    "Robot": "robot",
    "HoldoutRange": "rows.splitting",
    "SplitRule": "rows.splitting",
    "Update": "updating",
    "UpdateOptions": "updating",
    "roll_back": "updating",
    "update": "updating",
}


if not TYPE_CHECKING:  # to whom every name would be there

    def __getattr__(name: str) -> Any:  # noqa: ANN401 - any public name
        if name not in _HOME:
            raise AttributeError(f"module 'truearm' has no attribute '{name}'")
        return getattr(import_module(f"truearm.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__", *(name for name in globals() if name.startswith("__"))])
