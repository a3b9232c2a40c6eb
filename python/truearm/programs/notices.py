"""What is to be known of a rewritten program's load, tools and frames file."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.at_once import STEP_KINDS
from truearm.errors import Notice, list_names, typed
from truearm.fits.stillness import carried_joints, moved_joints, still_words
from truearm.inputs import PAYLOAD_KG, is_payload
from truearm.programs.declaring import maker_of
from truearm.programs.environment import Environment, Frame
from truearm.programs.frames import WORLDS, Frames, Kind
from truearm.programs.layouts import of_joints as layout_of_joints
from truearm.programs.program import Language, Program
from truearm.programs.rewriting import Rewritten
from truearm.robot import Robot
from truearm.update_words import MEANWHILE, cause_words

SAME_PAYLOAD_KG: Final = 0.05
MEASURED_M: Final = 1e-4
"""A tool this near to a measured point is that point."""
POSE: Final = 6
"""Joints that it takes to meet a position and an orientation."""
IN_WORDS: Final[dict[Kind, str]] = {"tool": "tool", "object": "work object"}


def payload_notices(program: Program, robot: Robot, features: Mapping[str, float]) -> list[Notice]:
    """What differs between the payloads that a program states and the one that its corrections are for.

    Args:
        program: The program.
        robot: The calibrated arm; its payload counts where no feature of the calibration is one.
        features: Values of the calibration's features, by name, that the program is corrected for.
    """
    stated = sorted({e.payload_kg for e in program.environments if e.payload_kg is not None})
    weights = {name: value for name, value in features.items() if is_payload(name)}
    if weights:
        others = _unlike(stated, weights.get(PAYLOAD_KG))
        given = ", ".join(f"{name} = {value:g}" for name, value in weights.items())
        option = typed(f"{PAYLOAD_KG if PAYLOAD_KG in weights else next(iter(weights))}=NUMBER")
        why, way_out = f"corrections are for {given}", f". Rewrite it once for each: --feature {option}"
    elif robot.payload is not None:
        others = _unlike(stated, robot.payload.mass_kg)
        why, way_out = f"the calibration was made with {robot.payload.mass_kg:g} kg", ""
    else:
        return []
    masses = " and ".join(f"{mass:g} kg" for mass in others)
    text = (
        f"the program states a payload of {masses}, {why}: what the arm yields under the difference is not "
        f"corrected{way_out}"
    )
    return [Notice("payload", text)] if others else []


def _unlike(stated: Sequence[float], corrected_for: float | None) -> list[float]:
    """Masses (ascending, kg) that are another than the one that is corrected for.

    Of one in an unknown unit only so much is known that it is not several at once.
    """
    if corrected_for is None:
        return list(stated) if len(stated) > 1 and stated[-1] - stated[0] > SAME_PAYLOAD_KG else []
    return [mass for mass in stated if abs(mass - corrected_for) > SAME_PAYLOAD_KG]


def language_notices(language: Language, robot: Robot) -> list[Notice]:
    """A warning where a program is in the language of another maker's controllers than the arm's."""
    maker = maker_of(robot)
    if maker in ("", language.maker.lower()) or not language.maker:
        return []
    text = (
        f"{language.name} is the language of {language.maker}'s controllers, and the calibration is of "
        f"{robot.name}: targets are corrected as if that arm ran the program. Take the calibration of the "
        "arm that runs it"
    )
    return [Notice("language", text)]


def frames_notices(program: Program, frames: Frames) -> list[Notice]:
    """Entries of the frames file that no tool or work object of the program has the name of."""
    return [notice for kind in IN_WORDS if (notice := _unasked(program, frames, kind)) is not None]


def _unasked(program: Program, frames: Frames, kind: Kind) -> Notice | None:
    frame_of = "tool" if kind == "tool" else "work_object"
    had = {getattr(environment, frame_of).name.casefold() for environment in program.environments}
    initial = {folded: name for folded, name in frames.asked.initial[kind].items() if folded in had}
    names = frames.asked.names[kind] | initial
    left = [entry.name for folded, entry in frames.of(kind).items() if folded not in names]
    if not left:
        return None
    noun = IN_WORDS[kind]
    several = "s" if len(left) > 1 else ""
    own = f"its {noun}s are {list_names(names.values())} there" if names else f"it asks for no {noun} there"
    return Notice(
        "frames",
        f"{noun}{several} {list_names(left)} of {frames.where} {'change' if several else 'changes'} nothing: "
        f"the program has none of that name, {own}",
    )


def update_notices(calibration: Calibration) -> list[Notice]:
    """A warning where an update found that the calibration no longer fits its arm, or something slipped
    while its rows were measured.
    """
    revision = calibration.revision
    if revision is None:
        return []
    if any(notice.kind in STEP_KINDS for notice in calibration.notices):
        text = f"What the update that this calibration is of was measured with changed meanwhile. {MEANWHILE}"
        return [Notice("update", text)]
    cause = revision.report.get("cause")
    if cause is not None and not cause["taken"]:
        text = (
            f"The update that this calibration is of found: {cause_words(revision.report)} Corrections are "
            "those of an arm as it was then."
        )
        return [Notice("update", text)]
    if revision.report["verdict"] != "field":
        return []
    text = (
        "The update that this calibration is of found that it no longer fits the arm: what it says of its "
        "standard deviation does not hold, and corrections may miss. Measure again and calibrate."
    )
    return [Notice("update", text)]


def still_notices(done: Rewritten, calibration: Calibration) -> list[Notice]:
    """Joints that stood still while the arm was measured, and move in the program."""
    rows, joints = calibration.learned_from, calibration.robot.joints
    if rows is None:
        return []
    known = rows.data.readings
    moved = moved_joints(known, done.nominal, joints)
    if not moved:
        return _carried_notices(carried_joints(known, done.corrected[done.changed], joints), joints)
    return [
        Notice(
            "moves_still_joint",
            f"the arm was measured with {still_words(moved, joints)} alone, and the program moves it: how "
            "far its targets are off there is not known, whatever std_mm says. Calibrate with poses in which "
            "every joint moves",
        )
    ]


def _carried_notices(carried: Mapping[int, float], joints: Sequence[str]) -> list[Notice]:
    """Joints, by their number from 1, that corrections take so far from where they stood, deg or mm."""
    if not carried:
        return []
    others = ",".join(str(joint) for joint in range(1, len(joints) + 1) if joint not in carried)
    text = (
        f"corrections move {still_words(carried, joints, 'by up to')}, which stood still while the arm was "
        "measured. Where it cannot move, as without a motor, or must not, leave it as it is: "
        f"--moving {others}"
    )
    return [Notice("still_joint_moved", text)]


def tool_notices(done: Rewritten, calibration: Calibration) -> list[Notice]:
    """Tools of changed targets of which a calibration does not know where they are.

    Positions tell of a point that the flange carries, and orientations how it is turned, not of the flange,
    from which a drawing or a controller measures a tool. A tool taught through the calibration is measured
    from the same point.
    """
    known = "positions and orientations of its target" if calibration.selection.orientation else "positions"
    doubtful = [tool for tool in _tools_of(done) if not (tool.taught or _is_measured(tool, calibration))]
    names = list(dict.fromkeys(tool.name for tool in doubtful if tool.name))
    if not doubtful:
        return []
    several, name = len(names) > 1, typed(names[0]) if names else "NAME"
    tools = f"tool{'s' if several else ''} {list_names(names)}" if names else "the program's tool"
    return [
        Notice(
            "tool",
            f"the calibration knows {known} alone, which do not tell where the flange is, and from there "
            f"{tools} {'are' if several else 'is'} measured: all targets may be off by more than std_mm "
            f"says. Teach {'each' if several else 'it'} again through the calibration: "
            f"truearm frame CALIB touches.csv --tool {name}",
        )
    ]


def unknown_tool_notices(done: Rewritten, moving: int) -> list[Notice]:
    """That residuals are of another point than the program's, where joints are too few to meet a whole pose.

    Args:
        done: The rewritten program.
        moving: How many joints may change.
    """
    unknown = [tool.unknown for tool in _tools_of(done) if tool.unknown]
    if moving >= POSE or not unknown:
        return []
    text = (
        f"{unknown[0]}: {moving} joints meet the position of one point first, and that of the robot file's "
        "tool was taken. The program's own may miss by more than is reported. Give its place: --frames FILE"
    )
    return [Notice("tool_unknown", text)]


def object_notices(done: Rewritten) -> list[Notice]:
    """Work objects of changed Cartesian targets that were not taught through a calibration.

    One that was touched with the arm as the controller has it holds the errors that the arm has there, and
    the uncorrected arm comes back to it with the same ones. Neither the base nor the controller's world is
    touched, and one that is elsewhere than the controller has it was told by whoever wrote the frames file.
    """
    places = {one.work_object.name: one for one in _environments_of(done, of_joints=False)}
    doubtful = {name: one for name, one in places.items() if name and not _is_told(one.work_object)}
    if not doubtful:
        return []
    names = list(doubtful)
    tool = next(iter(doubtful.values())).tool.name
    return [
        Notice(
            "object",
            f"work object{'s' if len(names) > 1 else ''} {list_names(names)}: not taught through the "
            "calibration. What was touched with the uncorrected arm holds its errors, and targets that are "
            "corrected without teaching it again may miss by more than they do now, whatever std_mm says. "
            f"Teach it again: truearm frame CALIB points.csv --object {typed(names[0])} "
            f"--with-tool {typed(tool) if tool else 'NAME'}",
        )
    ]


def _is_told(place: Frame) -> bool:
    """Whether a work object is base or world, was taught by a calibration, or is told to be elsewhere."""
    is_world = place.name.casefold() in {name.casefold() for name in WORLDS}
    is_base = is_world or np.array_equal(place.controller, np.eye(4))
    return place.taught or is_base or not np.array_equal(place.true, place.controller)


def _tools_of(done: Rewritten) -> list[Frame]:
    """Tools that motions to changed targets have."""
    return [one.tool for one in _environments_of(done)]


def _environments_of(done: Rewritten, *, of_joints: bool = True) -> list[Environment]:
    """Environments that motions to changed targets have, those to joint targets among them or not."""
    moves, targets = done.program.moves, done.program.targets
    joints = np.array([layout_of_joints(layout) for layout in done.program.layouts], dtype=bool)
    used = moves.moving & done.changed[moves.target]
    if not of_joints:
        used &= ~joints[targets.layout[moves.target]]
    return [done.program.environments[int(number)] for number in np.unique(moves.environment[used])]


def _is_measured(tool: Frame, calibration: Calibration) -> bool:
    """Whether a tool's point is one that was measured, as the calibration found it on the flange."""
    points = calibration.measured.points(calibration.model.setup.targets)
    distances = np.linalg.norm(points - tool.true[:3, 3], axis=1)
    return not tool.unknown and bool((distances < MEASURED_M).any())
