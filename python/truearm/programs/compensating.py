"""Compensating a program: the public call."""

from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from truearm.compensation import Compensator
from truearm.controller import Controller
from truearm.errors import UsageError
from truearm.files import existing
from truearm.inverse import Inverse
from truearm.kinds import required
from truearm.programs.declaring import declared_controller, refuse_another_arm, refuse_contradiction
from truearm.programs.frames import Frames
from truearm.programs.languages import language_of
from truearm.programs.marks import mark_text
from truearm.programs.notices import (
    POSE,
    frames_notices,
    language_notices,
    object_notices,
    payload_notices,
    still_notices,
    tool_notices,
    unknown_tool_notices,
    update_notices,
)
from truearm.programs.program import Language
from truearm.programs.rewriting import Choices, Models, Rewritten, Tell, read_program, rewrite
from truearm.robot import Robot
from truearm.solving import beyond_learnt, beyond_notices


def compensate_program(
    path: str | Path,
    compensator: Compensator,
    *,
    controller: Controller | str | Path | None = None,
    frames: Frames | str | Path | None = None,
    choices: Choices | None = None,
    tell: Tell = lambda _what, _done, _all: None,
) -> Rewritten:
    """Rewrite a program so that the calibrated arm's tool goes where its author meant it to go.

    Args:
        path: The program, or one of its files: KRL, RAPID, FANUC's listings, URScript, MELFA BASIC, or a
            path in CSV.
        compensator: From the author's model of the arm to the calibrated one.
        controller: What the controller computes with, "nominal", or a file of its own kinematics. Needed
            for arms whose controllers may have one.
        frames: Tools and work objects from outside the program, or the file that holds them.
        choices: What is to be done in case of doubt.
        tell: Called now and then with what is counted, how many are done, and of how many.

    Returns:
        The rewritten program, not yet saved.

    Raises:
        UsageError: If the controller must be declared and is not, or the language is not told.
        InputError: If a file cannot be read, or is no program, or the controller is of another arm.
        WorkError: If targets were refused, or the program was compensated already.
    """
    chosen = required(choices or Choices(), Choices, "the choices")
    compensator = required(compensator, Compensator, "the compensator")
    calibration, author = compensator.calibration, compensator.programming
    written_in = language_of(file := existing(path), chosen.language)
    declared = _declared(controller, written_in, calibration.robot)
    refuse_another_arm(declared, calibration.robot)
    known = _frames(frames).fresh()
    # Configuration data tells of the catalogue's postures; poses are of the tool that the author had.
    postured = replace(calibration.robot, tool=author.tool)
    program = read_program(file, written_in, postured, known)
    refuse_contradiction(program, declared, force=chosen.force)
    positions_only = not calibration.selection.orientation
    beyond = tuple(beyond_learnt(calibration, compensator.features))
    models = Models(
        author,
        Inverse(author),
        declared,
        compensator,
        compensator.task,
        compensator.task == "pose" and compensator.moving_count >= POSE,
        positions_only,
        beyond,
        compensator.limits.largest_std_mm,
    )
    mark = mark_text(version("truearm"), calibration.data_hash)
    done = rewrite(program, models, chosen, mark=mark, tell=tell)
    return done.with_facts(
        _facts(compensator, declared, chosen),
        [
            *language_notices(written_in, calibration.robot),
            *frames_notices(program, known),
            *payload_notices(program, calibration.robot, compensator.named_features),
            *update_notices(calibration),
            *still_notices(done, calibration),
            *tool_notices(done, calibration),
            *unknown_tool_notices(done, compensator.moving_count),
            *object_notices(done),
            *beyond_notices(calibration, compensator.features),
        ],
    )


def _facts(compensator: Compensator, declared: Controller, chosen: Choices) -> dict[str, Any]:
    """With what a program is rewritten, for the report."""
    calibration = compensator.calibration
    return {
        "calibration": {"data_hash": calibration.data_hash, "robot": calibration.robot.name},
        "controller": {"kind": declared.kind, "source": declared.source},
        "task": compensator.task,
        "offsets_mm": chosen.offsets_mm,
    }


def _declared(given: Controller | str | Path | None, language: Language, arm: Robot) -> Controller:
    """The controller's model as it is declared for the nominal arm that was calibrated, whoever the author.

    Raises:
        UsageError: If it must be declared and is not, or is of another kind of arm.
    """
    if given is None or isinstance(given, str | Path):
        declared = declared_controller(None if given is None else str(given), language, arm)
    else:
        declared = required(given, Controller, "the controller")
    if declared.robot.joints != arm.joints:
        raise UsageError(
            f"the controller's model {declared.robot.name} has other joints than {arm.name}",
            way_out="Declare the controller of this arm",
        )
    return declared


def _frames(given: Frames | str | Path | None) -> Frames:
    if given is None:
        return Frames()
    return given if isinstance(given, Frames) else Frames.load(Path(given))
