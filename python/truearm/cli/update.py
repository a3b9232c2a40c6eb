"""`truearm update`: an old calibration and a few new poses: what moved, and what still holds."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Final

import typer

from truearm.cli import update_options as option
from truearm.cli.again import calibrate_anew, plan_anew
from truearm.cli.arguments import AngleUnit, AsJson, CalibFile, LengthUnit, Use
from truearm.cli.console import print_json, print_table, say, say_wrapped, suggest, warn
from truearm.cli.given import given_options
from truearm.cli.interrupt import ends_promptly
from truearm.cli.next_commands import compensate_commands
from truearm.cli.progress import told_stages
from truearm.defaults import LEVEL, OFFSET_DEG, TOOL_MM
from truearm.errors import UsageError, typed
from truearm.result_names import CALIBRATION_NAME

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.measurements import Measurements
    from truearm.updating import Update, UpdateOptions
    from truearm.updating.moved import Motion, Offset

UPDATE_NAME: Final = "update.json"
SUFFIX: Final = ".calib"
FROM_NEW_ROWS: Final = "The old rows are of the arm as it was: calibrate from new ones alone."


def command(
    context: typer.Context,
    calibration: CalibFile,
    measurements: option.FilesOrNone = None,
    output: option.Output = None,
    keep_frame: option.KeepFrame = False,
    keep_tool: option.KeepTool = False,
    new_tool: option.NewTool = False,
    take_scale: option.TakeScale = False,
    offset_deg: option.OffsetDeg = OFFSET_DEG,
    tool_mm: option.ToolMm = TOOL_MM,
    level: option.Level = LEVEL,
    use: Use = None,
    roll_back: option.RollBack = False,
    length_unit: LengthUnit = None,
    angle_unit: AngleUnit = None,
    as_json: AsJson = False,
) -> None:
    """Take a calibration over to an arm that was re-mastered, repaired or run into something.

    From 10 to 20 poses it estimates joint offsets, frame and tool again, and keeps the field. It says what
    moved, whether the old calibration still holds, and whether its field does. The new file holds the old
    one too.

    Examples:
      truearm plan --acceptance 15 --from arm.calib -o poses.csv
      truearm update arm.calib measured.csv -o arm-new.calib
      truearm update --roll-back arm-new.calib -o arm-old.calib
    """
    files = measurements or []
    if roll_back:
        _roll_back(calibration, files, output, as_json=as_json)
        return
    if not files:
        raise UsageError("no measurements were given", rule="truearm update CALIB MEASUREMENTS...")
    place = None if output is None else _free_place(output)

    from truearm.calibration import Calibration
    from truearm.measurements import Measurements
    from truearm.updating import UpdateOptions

    options = UpdateOptions(
        offset_deg=offset_deg,
        tool_mm=tool_mm,
        keep_frame=keep_frame,
        keep_tool=keep_tool,
        new_tool=new_tool,
        take_scale=take_scale,
        level=level,
        use=use,  # type: ignore[arg-type]
    )
    known = Calibration.load(calibration)
    data = Measurements.read_files(
        files, length_unit=length_unit, angle_unit=angle_unit, joints=known.robot.joints
    )
    with ends_promptly():
        found = _updated(known, data, options, place)
    warn(found.notices)
    if as_json:
        print_json({"calibration": None if place is None else str(place), **found.to_dict()})
        return
    _print(found)
    if place is not None:
        say(f"Updated calibration: {place}")
    given = " ".join(map(typed, files)) + given_options(context, "output", "as_json")
    _suggest(found, known, calibration, place, given)


def _updated(
    known: "Calibration", data: "Measurements", options: "UpdateOptions", place: Path | None
) -> "Update":
    """Update a calibration, and write it to a place where one is named."""
    from truearm.updating import update

    found = update(known, data, options, stages=told_stages())
    if place is not None:
        _write(found, place)
    return found


def _roll_back(updated: Path, files: list[Path], output: Path | None, *, as_json: bool) -> None:
    from truearm.updating import roll_back

    if files or output is None:
        raise UsageError(
            "measurements were given" if files else "-o is missing",
            rule="truearm update --roll-back NEW.calib -o OLD.calib",
        )
    digest = roll_back(updated, output)
    if as_json:
        print_json({"calibration": str(output), "sha256": digest})
        return
    say(f"{output}: the calibration before the update, SHA-256 {digest}.")


def _free_place(output: Path) -> Path:
    """The file to write; nothing may be there, since nothing is overwritten."""
    place = output if output.suffix == SUFFIX else output / CALIBRATION_NAME
    written = [place, place.parent / UPDATE_NAME] if place.name == CALIBRATION_NAME else [place]
    for file in written:
        if file.exists():
            raise UsageError(
                "there is a file already",
                where=str(file),
                rule="An update overwrites nothing",
                way_out="Name another file with -o",
            )
    if place.parent.exists() and not place.parent.is_dir():
        raise UsageError(
            "this is a file", where=str(place.parent), rule=f"-o names a {SUFFIX} file or a directory"
        )
    return place


def _write(found: "Update", place: Path) -> None:
    from truearm.files import make_directory, write_whole

    if found.calibration.has_conservative:
        with told_stages()("bounding the standard deviation"):
            _ = found.calibration.conservative
    text = json.dumps(found.to_dict(), indent=2, allow_nan=False) + "\n"
    make_directory(place.parent)
    found.calibration.save(place)
    if place.name == CALIBRATION_NAME:
        write_whole(place.parent / UPDATE_NAME, text)


def _suggest(found: "Update", known: "Calibration", old: Path, place: Path | None, given: str) -> None:
    """What to do next.

    Args:
        found: What the update says.
        known: The calibration as it was.
        old: Its file.
        place: The file that was written, if any.
        given: The measurements, and the options that the command was given, as they were typed.
    """
    if found.changed_meanwhile:
        return
    if found.verdict == "field":
        anew = calibrate_anew(known)
        say_wrapped(" ".join((FROM_NEW_ROWS, *anew.notes)))
        suggest(plan_anew(known), anew.command, when="Measure anew:")
    elif found.is_less_certain:
        say_wrapped(f"The old calibration is the more certain: keep {typed(old)}.")
        suggest(*(compensate_commands(known, old) or [f"truearm report {typed(old)}"]))
    elif place is not None:
        suggest(f"truearm update --roll-back {typed(place)} -o OLD.calib", when="Back to the old one:")
    elif found.verdict == "moved" or (found.cause is not None and found.cause.taken):
        suggest(f"truearm update {typed(old)} {given} -o NEW.calib", when="Nothing was written. To do so:")
    elif found.cause is not None:
        _suggest_scale(found, f"truearm update {typed(old)} {given}")
    else:
        suggest(*(compensate_commands(known, old) or [f"truearm report {typed(old)}"]))


def _suggest_scale(found: "Update", update: str) -> None:
    """How a scale that was found is taken along by an update; nothing where it cannot be."""
    if found.verdict == "scale" and "prismatic" not in found.calibration.robot.joints:
        suggest(f"{update} --take-scale -o NEW.calib", when="If the arm works as it was measured now:")


def _verdict(found: "Update") -> str:
    """What was found, in a sentence or two."""
    from truearm.reporting.numbers import listed
    from truearm.update_words import (
        CHANGED_MEANWHILE,
        found_otherwise,
        of_known_world,
        untested_joints,
        way_out_of_keeping,
    )

    tested, estimated = listed(found.tested, "or").capitalize(), listed(found.estimated)
    if found.changed_meanwhile:
        return CHANGED_MEANWHILE[found.verdict].format(tested=tested, estimated=estimated.capitalize())
    untested = untested_joints(found.to_dict())
    if otherwise := found_otherwise(found.to_dict(), tested):
        return f"{otherwise} {untested}".strip()
    if found.verdict == "holds":
        return f"The calibration still holds: no significant change was found. {untested}".strip()
    if found.verdict == "moved":
        return (
            f"{tested} changed. All else still fits, so the updated "
            f"calibration replaces the old one. {untested}"
        ).strip()
    kept, base = way_out_of_keeping(found.kept), of_known_world(found.to_dict())
    return (
        f"The calibration itself no longer fits: {estimated} do not explain what was measured. "
        f"{kept and f'{kept}. '}{base and f'{base} '}Check that these are measurements of this arm. If they "
        "are, measure anew and calibrate. If the measuring device scatters more than when the arm was "
        "calibrated, say so in a column sigma_mm and update again."
    )


def _print(found: "Update") -> None:
    from truearm.reporting.numbers import listed, probability
    from truearm.update_words import follows_words, motion_name, untested_words

    say_wrapped(f"{found.calibration.robot.name}, {found.n_poses} poses. {_verdict(found)}")
    print_table(
        ("joint", "change of offset", "std error", "p", ""), [_offset(o) for o in found.offsets], left=(0, 4)
    )
    for offset in found.offsets:
        if offset.follows is not None:
            say_wrapped(follows_words(offset.joint, offset.follows))
    if untested := untested_words(found.to_dict(), found.calibration.groups):
        say_wrapped(untested)
    for motion in (*found.frames, *found.tools):
        named = motion_name(motion.part, motion.group)
        say(f"{named[:1].upper()}{named[1:]}: {_motion(motion)}.")
    if any(motion.moved for motion in found.tools):
        say_wrapped(
            "If it is another target, or was taken off, give --new-tool: that is no change of the arm."
        )
    print_table(
        ("error at left-out poses, mm", "mean", "RMS", "largest"),
        [
            [name, f"{e.position.mean:.3f}", f"{e.position.rms:.3f}", f"{e.position.max:.3f}"]
            for name, e in (("old calibration", found.before), ("updated", found.after))
        ],
    )
    say_wrapped(
        f"Test for a change of {listed(found.tested)}: p {probability(found.changed.p)}. "
        f"Test of the residuals that remain: p {probability(found.rest.p)}. "
        "A small p is unlikely for an arm that did not change: "
        f"each counts below {found.threshold:g}, half the level of {found.level:g} that the two share."
    )


def _offset(entry: "Offset") -> list[str]:
    """Cells of a joint."""
    from truearm.reporting.numbers import probability

    name = str(entry.joint)
    if entry.std is None or entry.p is None:
        why = f"confounded with the {entry.confounded}" if entry.confounded else "not determined"
        return [name, "kept", "", "", why]
    change = f"{entry.change:+.4f} {entry.unit}"
    return [name, change, f"{entry.std:.4f}", probability(entry.p), "changed" if entry.moved else ""]


def _motion(motion: "Motion") -> str:
    """How far a frame or tool is from where it was."""
    from truearm.reporting.numbers import probability

    if motion.kept:
        return "kept as it was"
    turn = "" if motion.angle_deg is None else f" and {motion.angle_deg:.4f} deg"
    away = f"{motion.largest_mm:.3f} mm{turn} from where it was"
    if motion.p is None:
        return f"found anew, {away}"
    return f"{away} (p {probability(motion.p)}{', changed' * motion.moved})"
