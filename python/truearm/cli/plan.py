"""`truearm plan`: choose measurement poses."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from truearm.cli import plan_options as option
from truearm.cli.again import NEW_FILE, Again, calibrate_again, calibrate_anew, plan_anew
from truearm.cli.arguments import AsJson
from truearm.cli.console import print_json, print_table, say, say_wrapped, suggest
from truearm.cli.interrupt import ends_promptly
from truearm.cli.plan_ways import tell_ways
from truearm.cli.progress import told_stages
from truearm.defaults import THERE_AND_BACK
from truearm.errors import UsageError, count_of, list_names, typed
from truearm.files import check_output, refuse_same
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.cell.cell_file import Cell
    from truearm.cell.plan import Plan
    from truearm.cell.proposed import Proposed
    from truearm.planning.accessibility import Rule
    from truearm.robot import Robot

NUMBERS: Final = (20, 40, 60, 100, 200)
MEASURED: Final = "Measure them; then:"
ANEW: Final = (
    "An update of the calibration before finds what moved from all rows since. What varies can only be "
    "learned anew from as many poses as before."
)
WORSE: Final = (
    "Such an update is expected to leave no less uncertain than {file} is: it may find less than the updates "
    "before did. Keep that, or calibrate anew."
)
GOOD_NUMBER: Final = 10
"""Poses from which few are no reason why they tell of no change."""
FEW: Final = "So few poses tell of no change: 10 to 20 are a good number."
MORE: Final = "These poses tell of no change: with this noise it takes more of them."
ALIKE: Final = (
    "No number of poses tells here whether a joint moved against its reading: that looks like another place "
    "of the device, or of the target on the flange. Where the device stands where it stood, and the target "
    "sits where it sat, update with --keep-frame and --keep-tool tells it."
)
PICTURES: Final = (".png", ".svg", ".pdf")


def command(
    robot: option.RobotOrNone = None,
    count: option.Count = None,
    output: option.Output = None,
    cell: option.CellReaching = None,
    criterion: option.Criterion = "d",
    next_count: option.NextCount = None,
    acceptance: option.Acceptance = None,
    known: option.Known = None,
    group: option.Group = None,
    order: option.Order = THERE_AND_BACK,
    sigma_mm: option.SigmaMm = 0.1,
    floor_mm: option.FloorMm = None,
    link_radius_mm: option.LinkRadiusMm = None,
    box_mm: option.BoxMm = None,
    seed: option.Seed = 0,
    picture: option.Picture = None,
    as_json: AsJson = False,
) -> None:
    """Choose the poses that determine an arm's parameters best, from candidates that can be measured.

    A quarter as many are added to judge by, spread over the space, and a tenth are repeated: at once from
    the other side, and at the end. They come from lower and higher joint readings in turn, in an order from
    low to high and back. The expected accuracy for several numbers of poses helps to choose N.

    With --from CALIB: --next proposes the poses that reduce the expected error over the workspace most given
    what is known already; --acceptance those that show best whether the calibration still holds.

    Examples:
      truearm plan ur10 -n 100 -o poses.csv
      truearm plan rv-m2 -n 60 --cell cell.toml -o poses.csv
      truearm plan ur10 --floor-mm 50 --box-mm -900,-900,100,900,900,1200
      truearm plan --next 20 --from arm/calibration.calib -o more.csv
      truearm plan --acceptance 10 --from arm/calibration.calib -o check.csv
    """
    from truearm.cell.cell_file import Cell
    from truearm.cell.plan import PlanOptions, plan_poses

    _check_words(criterion, order)
    _check_counts({"--next": next_count, "--acceptance": acceptance, "--count": count})
    target = output or option.OUTPUT
    _check_outputs(target, picture, robot, known, cell)
    rules = room(floor_mm, box_mm)
    if known is not None or next_count is not None or acceptance is not None:
        if count is not None:
            raise UsageError(
                "--count is given where poses are proposed", rule="--next or --acceptance says how many"
            )
        _propose(
            _Asked(robot, known, next_count, acceptance, group, cell, seed, order, rules, link_radius_mm),
            output,
            picture,
            as_json,
        )
        return
    if robot is None:
        raise UsageError("no robot is named", rule="truearm plan ROBOT, or with --from CALIB")
    known_cell = None if cell is None else Cell.load(cell)
    arm = _arm_of(robot, known_cell)
    number = count or option.COUNT
    options = PlanOptions(number, criterion, seed, order, sigma_mm, rules, link_radius_mm)  # type: ignore[arg-type]
    with ends_promptly():
        with told_stages()("choosing poses"):
            plan = plan_poses(arm, options, cell=known_cell, numbers=NUMBERS)
        _save(plan, output, picture)
    _print(plan, target, order, arm.joints, as_json=as_json)
    if not as_json and cell is not None:
        suggest(f"truearm measure {typed(cell)} {typed(target)} --dry-run")
    elif not as_json:
        suggest(f"truearm calibrate {typed(robot)} {NEW_FILE} -o result", when=MEASURED)


def room(floor_mm: float | None, box_mm: str | None) -> "tuple[Rule, ...]":
    """What --floor-mm and --box-mm ask of every pose.

    Raises:
        UsageError: If the box is not made of six numbers, two corners.
    """
    from truearm.planning import AboveFloor, InBox

    rules: list[Rule] = []
    if floor_mm is not None:
        if not math.isfinite(floor_mm):
            raise UsageError(f"{floor_mm:g}", where="--floor-mm", rule="It must be finite")
        rules.append(AboveFloor(floor_mm / MM_PER_METRE))
    if box_mm is not None:
        try:
            numbers = [float(part) / MM_PER_METRE for part in box_mm.split(",")]
        except ValueError:
            numbers = []
        low, high = numbers[:3], numbers[3:]
        if len(numbers) != 6 or not all(a < b for a, b in zip(low, high, strict=True)):
            rule = "Six numbers, the lowest x, y, z and then the highest, mm in the base frame"
            raise UsageError(f'"{box_mm}"', where="--box-mm", rule=rule)
        rules.append(InBox(low, high))
    return tuple(rules)


def _check_words(criterion: str, order: str) -> None:
    """Raise UsageError where a criterion or an order is not known."""
    from truearm.cell.plan import ORDERS
    from truearm.planning.choosing import CRITERIA

    for word, allowed in ((criterion, CRITERIA), (order, ORDERS)):
        if word not in allowed:
            raise UsageError(f'"{word}" is not known', rule=f"One of {', '.join(allowed)}")


def _check_counts(asked: Mapping[str, int | None]) -> None:
    """Raise UsageError where fewer than one pose is asked for by an option."""
    for name, number in asked.items():
        if number is not None and number < 1:
            raise UsageError(f"{number} poses", where=name, rule="At least one")


def _check_outputs(output: Path, picture: Path | None, *inputs: Path | str | None) -> None:
    """Raise InputError where no file can come or what is there is read, UsageError where one is asked for
    twice or a picture has no known format.
    """
    check_output(output, *inputs)
    if picture is None:
        return
    check_output(picture, *inputs)
    refuse_same(output, picture, option="--picture")
    if picture.suffix.lower() not in PICTURES:
        rule = f"Its name ends in {list_names(PICTURES, 'or')}"
        raise UsageError(str(picture), where="--picture", rule=rule)


def _arm_of(robot: str, cell: "Cell | None") -> "Robot":
    """The arm that is named, which is the cell's if there is one."""
    from truearm.cell.proposed import check_same_tables
    from truearm.robot import Robot

    arm = Robot.load(robot)
    if cell is None:
        return arm
    check_same_tables(arm, cell.arm, f"the cell is of {cell.arm.name}")
    return cell.arm


@dataclass(frozen=True)
class _Asked:
    """What is to be proposed."""

    robot: str | None
    calibration: Path | None
    next_count: int | None
    acceptance: int | None
    group: str | None
    cell: Path | None
    seed: int
    order: str
    rules: "tuple[Rule, ...]"
    link_radius_mm: float | None


def _propose(asked: _Asked, output: Path | None, picture: Path | None, as_json: bool) -> None:
    from truearm.calibration import Calibration
    from truearm.cell.proposed import (
        ProposalOptions,
        check_same_arm,
        kept_still,
        propose_acceptance,
        propose_next,
    )
    from truearm.robot import Robot

    if asked.calibration is None or (asked.next_count is None) == (asked.acceptance is None):
        raise UsageError(
            "--next or --acceptance propose poses from a calibration, one at a time",
            rule="truearm plan --next N --from CALIB, or --acceptance N --from CALIB",
        )
    calibration = Calibration.load(asked.calibration)
    if asked.robot is not None:
        check_same_arm(calibration, Robot.load(asked.robot))
    cell = _cell_of(calibration, asked.cell)
    choose = propose_next if asked.acceptance is None else propose_acceptance
    number = asked.next_count or asked.acceptance or 0
    again = calibrate_again(calibration, asked.robot, NEW_FILE)
    options = ProposalOptions(
        number,
        asked.seed,
        asked.order,
        asked.group,
        asked.rules,
        *again.update,
        link_radius_mm=asked.link_radius_mm,
    )
    with ends_promptly():
        with told_stages()("choosing poses"):
            proposed = choose(calibration, options, cell=cell)
        _save(proposed, output, picture)
    kept, target = kept_still(calibration), output or option.OUTPUT
    if as_json:
        by_joint = {str(joint): at for joint, at in kept.items()}
        print_json({"poses": str(target), "order": asked.order, **proposed.to_dict(), "kept": by_joint})
        return
    _print_proposed(proposed, target, calibration.robot.joints, holds=again.holds)
    _print_still(kept, calibration.robot.joints)
    _print_features(calibration.options.features)
    if asked.acceptance is not None:
        suggest(f"truearm update {typed(asked.calibration)} {NEW_FILE}", when=MEASURED)
    else:
        _suggest_again(again, calibration, asked.calibration, proposed)


def _cell_of(calibration: "Calibration", file: Path | None) -> "Cell | None":
    """The cell of a file, if one is named, which has to be of the calibrated arm."""
    from truearm.cell.cell_file import Cell
    from truearm.cell.proposed import check_same_arm

    if file is None:
        return None
    cell = Cell.load(file)
    check_same_arm(calibration, cell.arm)
    return cell


def _save(plan: "Plan | Proposed", output: Path | None, picture: Path | None) -> None:
    """Write the poses, over others only in a file that is named, and draw them where that is asked for."""
    from truearm.cell.plan_files import draw, write

    write(plan, output or option.OUTPUT, over=output is not None)
    if picture is not None:
        draw(plan, picture)


def _suggest_again(again: Again, calibration: "Calibration", file: Path, proposed: "Proposed") -> None:
    update = f"truearm update {typed(file)} {NEW_FILE}"
    if not again.apart:
        say_wrapped(f"Older rows count only if the arm has not changed since: {update} tells.")
    for note in again.notes:
        say_wrapped(note)
    if not again.apart:
        suggest(again.command, when="Then calibrate:" if again.notes else "Then calibrate from all:")
        return
    say_wrapped(ANEW)
    if not proposed.teaches:
        say_wrapped(WORSE.format(file=typed(file)))
    elif again.holds:
        suggest(*again.updates(file, NEW_FILE), when=MEASURED)
    suggest(plan_anew(calibration), calibrate_anew(calibration).command, when="To calibrate anew:")


def _print_proposed(
    proposed: "Proposed", output: Path, joints: "tuple[str, ...]", *, holds: bool = True
) -> None:
    told = proposed.to_dict()
    say(f"{count_of(told['count'], 'pose')}: {output}")
    say_wrapped(_motion(proposed.seconds, joints))
    tell_ways(proposed.passage)
    if "noticed" not in told:
        before, after = told["expected_before_mm"], told["expected_after_mm"]
        then = f", {after[-1]:.3f} mm when these are measured too" if after else ""
        if holds:
            say_wrapped(
                f"Expected standard deviation of the target's position over the workspace: {before:.3f} mm "
                f"now{then} ({told['measured']})."
            )
        say_wrapped(
            f'Measure them in the set-up "{proposed.poses.group}", with device and target where they were, '
            'and keep the column "group", which says so.'
        )
        return
    if not told["noticed"]:
        say_wrapped(ALIKE if told["alike"] else FEW if told["count"] < GOOD_NUMBER else MORE)
        return
    say_wrapped(f"Smallest change that is noticed in 95 of 100 cases ({told['measured']}):")
    rows = [[name, f"{value:.4f}"] for name, value in told["noticed"].items()]
    print_table(("offset of joint in deg (mm), tool in mm (worst direction)", ""), rows)


def _print_still(kept: Mapping[int, float], joints: Sequence[str]) -> None:
    from truearm.fits.stillness import still_words

    if kept:
        say_wrapped(
            f"Kept: {still_words(kept, joints)}, as in all measurements. For poses in "
            "which every joint moves: truearm plan ROBOT -n N"
        )


def _print_features(features: Sequence[str]) -> None:
    """Say what has to be noted at each pose."""
    if features:
        where = f"{'each ' * (len(features) > 1)}in a column of its name"
        say_wrapped(f"Note {list_names(features)} at each pose, {where}: the calibration varies with that.")


def _motion(seconds: "dict[str, float]", joints: "tuple[str, ...]") -> str:
    from truearm.cell.plan import JOINT_SPEED_RAD_S

    units = [unit for unit, kind in (("rad/s", "revolute"), ("m/s", "prismatic")) if kind in joints]
    speed = " and ".join(f"{JOINT_SPEED_RAD_S:g} {unit}" for unit in units)
    back, short, paper = seconds[THERE_AND_BACK], seconds["short"], seconds["paper"]
    return (
        f"Motion of the joints at {speed}: {back:.0f} s there and back, {short:.0f} s in "
        f"short order, {paper:.0f} s in the paper's. The way to the first pose, coming from one side, the "
        "sensor, contacts for the frame and checks come on top."
    )


def _print(plan: "Plan", output: Path, order: str, joints: "tuple[str, ...]", *, as_json: bool) -> None:
    purposes = {name: plan.poses.purpose.count(name) for name in ("train", "validate", "repeat")}
    if as_json:
        print_json(
            {
                "poses": str(output),
                "purposes": purposes,
                "before": plan.choice.before,
                "after": plan.choice.after,
                "motion_s": plan.seconds,
                "order": order,
                "expected_mm": {str(n): value for n, value in plan.expected.items()},
                **plan.passage.to_dict(),
            }
        )
        return
    say_wrapped(
        f"{purposes['train']} poses to fit to, {purposes['validate']} to judge by, "
        f"{purposes['repeat']} repeated: {output}"
    )
    before, after = plan.choice.before, plan.choice.after
    kappa = f"{before['kappa']:.1f} at random, {after['kappa']:.1f} chosen"
    times = after["o1"] / before["o1"]
    say_wrapped(
        f"They determine the parameters {times:.2f} times as well as poses at random, in the geometric mean "
        f"(index O1). Condition number {kappa} (1 rad counted as 300 mm)."
    )
    say_wrapped(_motion(plan.seconds, joints))
    tell_ways(plan.passage)
    rows = [[str(n), f"{value:.3f}"] for n, value in plan.expected.items()]
    say("Expected standard deviation of the calibrated position, from constants alone:")
    print_table(("poses", "mm"), rows)
