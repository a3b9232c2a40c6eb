"""`truearm calibrate`: learn an arm's parameters from measurements and judge them on held-out ones."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truearm.cli import calibrate_options as option
from truearm.cli.arguments import (
    AngleUnit,
    AsJson,
    LengthUnit,
    MeasurementFiles,
    OutputDirectory,
    RobotName,
    Use,
)
from truearm.cli.console import print_json, say, say_wrapped, suggest, tell, warn
from truearm.cli.interrupt import ends_promptly
from truearm.cli.next_commands import compensate_commands
from truearm.cli.progress import told_stages
from truearm.cli.report import make_report
from truearm.defaults import DEGREE, DRIFT, FIRST_TARGET, FRAME, HOLDOUT, MODEL, ROBUST, SEED
from truearm.errors import InputError, UsageError, count_of, list_outliers, typed
from truearm.files import (
    check_takes_files,
    is_file,
    make_directory,
    read_bytes,
    refuse_own_input,
    remove,
    write_whole,
)
from truearm.fits.scheme_options import SchemeOptions
from truearm.result_names import CALIBRATION_NAME, REPORT_NAME, SUMMARY_NAME
from truearm.stages import Stages

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.fits.options import CalibrationOptions
    from truearm.measurements import Measurements
    from truearm.robot import Robot

SCHEME = SchemeOptions()
PREVIOUS_NAME = "calibration.previous.calib"


def command(
    robot: RobotName,
    measurements: MeasurementFiles,
    output: OutputDirectory,
    holdout: option.Holdout = None,
    seed: option.Seed = SEED,
    train_size: option.TrainSize = None,
    split_by: option.SplitBy = None,
    holdout_range: option.HoldoutRange = None,
    use: Use = None,
    judge_target: option.JudgeTarget = FIRST_TARGET,
    model: option.Model = MODEL,
    robust: option.Robust = ROBUST,
    drift: option.Drift = DRIFT,
    features: option.Features = None,
    frame: option.Frame = FRAME,
    no_refit: option.NoRefit = False,
    strip: option.Strip = False,
    length_unit: LengthUnit = None,
    angle_unit: AngleUnit = None,
    scheme_joints: option.SchemeJoints = None,
    demanded_mm: option.DemandedMm = SCHEME.demanded_mm,
    regions: option.Regions = SCHEME.most_regions,
    region_rows: option.RegionRows = SCHEME.region_rows,
    region_ceps: option.RegionCeps = SCHEME.region_ceps,
    train_on: option.TrainOn = SCHEME.train_on,
    membership: option.Membership = SCHEME.membership,
    composition: option.Composition = SCHEME.composition,
    repeatability_mm: option.RepeatabilityMm = None,
    as_json: AsJson = False,
    degree: option.Degree = DEGREE,
    threads: option.Threads = None,
) -> None:
    """Calibrate an arm and judge the calibration on poses that took no part in it.

    Writes DIR/calibration.calib, fitted to all rows after the errors were judged, DIR/summary.json and
    DIR/report.html, which opens in any browser. Another calibration that is there is kept as
    DIR/calibration.previous.calib.

    Examples:
      truearm calibrate ur10 measurements.csv -o result
      truearm calibrate arm.toml monday.csv tuesday.csv -o result
      truearm calibrate ur10 m.csv -o result --model constant --seed 3
    """
    from truearm.fits.options import CalibrationOptions
    from truearm.measurements import Measurements
    from truearm.robot import Robot

    options = CalibrationOptions.of(
        holdout=_holdout(holdout, holdout_range),
        seed=seed,
        train_size=train_size,
        split_by=split_by or (),
        holdout_range=holdout_range,
        by_purpose=holdout is None,
        use=use,
        judge_target=judge_target,
        model=model,
        robust=robust,
        drift=drift,
        features=features or (),
        frame=frame,
        refit=not no_refit,
        degree=degree,
        scheme_joints=_numbers(scheme_joints),
        demanded_mm=demanded_mm,
        most_regions=regions,
        region_rows=region_rows,
        region_ceps=region_ceps,
        train_on=train_on,
        membership=membership,
        composition=composition,
        repeatability_mm=repeatability_mm,
    )
    check_directory(output)
    for name in (CALIBRATION_NAME, PREVIOUS_NAME, SUMMARY_NAME, REPORT_NAME):
        refuse_own_input(output / name, robot, *measurements)
    arm = Robot.load(robot)
    data = Measurements.read_files(
        measurements, length_unit=length_unit, angle_unit=angle_unit, joints=arm.joints
    )
    with ends_promptly():
        calibration = _calibrated(arm, data, options, threads)
        summary = write_results(calibration, output, with_rows=not strip)
    warn(calibration.notices)
    if as_json:
        print_json(summary)
        return
    print_results(calibration)
    print_places(output)
    suggest_next(calibration, output / CALIBRATION_NAME)


def _calibrated(
    arm: "Robot", data: "Measurements", options: "CalibrationOptions", threads: int | None
) -> "Calibration":
    """Calibrate, telling of the stages."""
    from truearm.calibrating import calibrate

    stages = told_stages(f"calibrate {arm.name} {options.model}", len(data))
    calibration = calibrate(arm, data, options, threads=threads, stages=stages)
    bound_std(calibration, stages)
    return calibration


def suggest_next(calibration: "Calibration", file: Path) -> None:
    """Name the commands that come next: none that uses a calibration that does not help, or of which
    something slipped while it was measured.

    Where compensation would refuse most measured rows, it is said why, and which option allows them.
    """
    from truearm.doubts.at_once import STEP_KINDS
    from truearm.doubts.few_judged import UNDECIDED
    from truearm.doubts.of_results import OF_NO_USE, ORIENTATION_MISFIT
    from truearm.reporting.facts import Facts

    evaluate = [] if calibration.selection.distances else [f"truearm evaluate {typed(file)} OTHER.csv"]
    kinds = {notice.kind for notice in calibration.notices}
    if kinds & {*OF_NO_USE, *STEP_KINDS, UNDECIDED, ORIENTATION_MISFIT}:
        suggest(f"truearm report {typed(file)}", *(evaluate if UNDECIDED in kinds else []))
        return
    facts = Facts(calibration)
    if facts.mostly_refused:
        say_wrapped(facts.mostly_refused)
    more = "" if facts.waypoints is None else facts.waypoints.allowing
    compensate = compensate_commands(calibration, file, more)
    if calibration.selection.distances:
        suggest(*compensate, f"truearm export {typed(file)} --to dh-toml -o arm.toml")
    else:
        suggest(*evaluate, *compensate)


def _holdout(share: float | None, holdout_range: str | None) -> float:
    if share is not None and holdout_range is not None:
        raise UsageError(
            "--holdout and --holdout-range both say how much is held out", way_out="Give one of them"
        )
    return HOLDOUT if share is None else share


def _numbers(joints: str | None) -> tuple[int, ...]:
    if joints is None:
        return SCHEME.scheme_joints
    parts = [part.strip() for part in joints.split(",")]
    if not all(part.isdigit() for part in parts):
        raise UsageError(f'"{joints}"', where="--scheme-joints", rule="Numbers of joints with commas: 2,3,4")
    return tuple(int(part) for part in parts)


def check_directory(output: Path) -> None:
    """Raise InputError, before any work, if nothing can be written to the directory `output`."""
    there = next(place for place in (output, *output.absolute().parents) if place.exists())
    if not there.is_dir():
        raise InputError("this is a file", where=str(there), rule="-o names a directory")
    if not os.access(there, os.W_OK):
        raise InputError("no permission to write here", where=str(there), way_out="Name another with -o")
    check_takes_files(there)


def bound_std(calibration: "Calibration", stages: Stages) -> None:
    """Work out the bounds of the standard deviation that the file carries; takes some seconds."""
    if calibration.has_conservative:
        with stages("bounding the standard deviation"):
            _ = calibration.conservative


def write_results(calibration: "Calibration", output: Path, *, with_rows: bool = True) -> dict[str, Any]:
    """Write all three files to a directory, which is made if needed; the content of summary.json.

    Another calibration that is there is kept beside them as PREVIOUS_NAME; its report goes first,
    so that none stands beside a calibration that it is not of.
    """
    summary, content = calibration.summary, calibration.to_bytes(with_rows=with_rows)
    text = json.dumps(summary, indent=2, allow_nan=False) + "\n"
    make_directory(output)
    _keep_previous(output, content)
    remove(output / REPORT_NAME)
    write_whole(output / CALIBRATION_NAME, content)
    write_whole(output / SUMMARY_NAME, text)
    make_report(calibration if with_rows else calibration.without_rows(), output / REPORT_NAME)
    return summary


def _keep_previous(output: Path, content: bytes) -> None:
    """Keep the calibration that is replaced by another one, and say so."""
    replaced = output / CALIBRATION_NAME
    if not is_file(replaced) or (before := read_bytes(replaced)) == content:
        return
    write_whole(output / PREVIOUS_NAME, before)
    tell(f"The calibration that was there is kept as {output / PREVIOUS_NAME}.")


def print_places(output: Path) -> None:
    """Say where the files are."""
    say(f"Calibration: {output / CALIBRATION_NAME}")
    say(f"Summary:     {output / SUMMARY_NAME}")
    say(f"Report:      {output / REPORT_NAME}")


def print_results(calibration: "Calibration") -> None:
    """Print what was determined, the errors, and what stands out."""
    from truearm.cli.error_tables import print_errors
    from truearm.doubts.few_judged import few_in_words
    from truearm.outlier_fate import taken_out

    validation, summary = calibration.validation, calibration.summary
    others = count_of(validation.n_holdout, "other")
    trained = f"fitted to {count_of(validation.n_train, 'row')}, judged on {others}"
    if validation.n_planned:
        whole = validation.n_planned == validation.n_holdout
        trained += f", {'' if whole else f'{validation.n_planned} of them '}planned to validate"
        trained += " (--holdout draws others)"
    say_wrapped(f"{calibration.robot.name}, {', '.join(calibration.groups)}: {trained}.")
    print_determined(calibration)
    print_errors(validation.holdout, _judged_in_words(calibration), calibration.selection.errors_of)
    if validation.drift is not None:
        say_wrapped(validation.drift.words)
    if few := few_in_words(calibration):
        say_wrapped(few)
    _print_noise(calibration, summary)
    if validation.coverage_95 is not None:
        inside = f"{100 * validation.coverage_95:.1f} %"
        say(f"The variable model's 95 % intervals hold {inside} of the held-out coordinates.")
    _print_scheme(calibration, summary["error_to_repeatability"])
    _print_outliers(summary["outliers"], calibration)
    if calibration.options.refit and calibration.rows is not None:
        without = taken_out(calibration)
        but = f" but {count_of(without, 'outlier')}" if without else ""
        say(f"The calibration in the file is fitted to all {len(calibration.rows.data)} rows{but}.")


def _judged_in_words(calibration: "Calibration") -> str:
    """How many were judged: rows, or poses where those are fewer, or distances, of which a pair has one."""
    validation = calibration.validation
    if validation.n_holdout_distances is not None or validation.n_holdout_poses < validation.n_holdout:
        return validation.poses_judged
    return count_of(validation.n_holdout, "held-out row")


def _print_noise(calibration: "Calibration", summary: dict[str, Any]) -> None:
    """Say what the model leaves unexplained, and the mean error of that: few models leave noise alone."""
    from truearm.doubts.moved_words import TAKEN_FOR_NOISE
    from truearm.fits.models import CONSTANT, leaves_noise
    from truearm.outlier_fate import FULL_WEIGHT, fate_of_outliers
    from truearm.storage.summary import states_sigma

    per = "distance" if calibration.selection.distances else "coordinate"
    if len(calibration.selection.targets) > 1:
        per += " of all targets together"
    beyond = ", beyond the stated sigma" if states_sigma(calibration) else ""
    left = f"{summary['noise_floor_mm']:.3f} mm"
    name = calibration.model_name
    also = "with constants alone" if name == CONSTANT else f"with the model {name}"
    it = "With that sigma it" if beyond else "It"
    kept = bool(summary["outliers"]) and fate_of_outliers(calibration) == FULL_WEIGHT
    noise = "noise, the outliers" if kept else "noise"
    if not leaves_noise(name):
        alone = f"{it} makes a mean error of {left}: {noise} and, {also}, what varies with the joints."
    elif any(notice.kind in TAKEN_FOR_NOISE for notice in calibration.notices):
        alone = f"{it} makes a mean error of {left}: {noise}, and what is taken for it, as a warning says."
    else:
        alone = f"Mean error that noise alone would leave: {left}."
    say_wrapped(
        f"Standard deviation of what the model does not explain{beyond}: {summary['noise_mm']:.3f} mm per "
        f"{per}. {alone}"
    )


def print_determined(calibration: "Calibration") -> None:
    """Say which parameters the measurements determine, and what the others cannot be told from."""
    from truearm.storage.summary import saw_orientations

    found = calibration.identifiability
    say(f"The poses determine {found.rank} of {found.parameters} parameters of the arm.")
    for words, names in _by_reason(found.undetermined, found.words).items():
        say_wrapped(f"  {', '.join(names)} {words}")
    if len(calibration.selection.targets) in (1, 2) and not calibration.selection.orientation:
        was_not = "used (--use pose uses it)" if saw_orientations(calibration) else "measured"
        say_wrapped(
            f"Orientation was not {was_not}: the tool's follows from positions alone, and nothing below "
            "validates it."
        )


def _by_reason(names: tuple[str, ...], sentences: tuple[str, ...]) -> dict[str, list[str]]:
    """Undetermined names by what is said of them."""
    grouped: dict[str, list[str]] = {}
    for name, sentence in zip(names, sentences, strict=True):
        grouped.setdefault(sentence.removeprefix(name).strip(), []).append(name)
    return grouped


def _print_scheme(calibration: "Calibration", ratios: dict[str, float] | None) -> None:
    """Say how the workspace was divided, how training ended, and how errors compare with repeatability."""
    details = calibration.scheme
    if details is not None and details.regions:
        of = f"{details.regions_with_rows} of {details.regions} regions have CEPs of their own"
        kappa = details.condition_median
        say_wrapped(f"{of}{'' if kappa is None else f', condition number {kappa:.0f} in the median'}.")
    if details is not None and details.epochs is not None:
        left = f"{details.largest_left_mm:.3g} mm left at most (angles at 300 mm)"
        say_wrapped(f"Training, {count_of(details.epochs, 'epoch')}, {left}: {details.ended}.")
    if ratios is not None:
        words = ", ".join(f"{name} {ratio:.1f}" for name, ratio in ratios.items())
        say_wrapped(f"Mean error in multiples of the repeatability: {words}.")


def _print_outliers(outliers: list[dict[str, Any]], calibration: "Calibration") -> None:
    from truearm.doubts.outliers import Outliers
    from truearm.outlier_fate import FULL_WEIGHT, TAKEN_OUT, fate_of_outliers

    if not outliers or calibration.rows is None:
        return
    fate = fate_of_outliers(calibration)
    hint = {
        TAKEN_OUT: " Constants, frame and tool are without them where they bend these.",
        FULL_WEIGHT: " --robust cauchy gives them hardly any weight.",
    }.get(fate, "")
    say_wrapped(f"Outliers, {fate}: {list_outliers(outliers, calibration.rows.data.files)}.{hint}")
    without = Outliers.of(calibration)
    units = {"mm": without.means_mm, "mrad": without.means_mrad}
    said = [
        f"{', '.join(f'{name} {mean:.3f}' for name, mean in means.items())} {unit}"
        for unit, means in units.items()
        if means
    ]
    if said:
        say_wrapped(f"Mean error without the held-out ones among them: {'; '.join(said)}.")
