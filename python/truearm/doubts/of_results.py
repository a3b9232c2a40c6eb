"""Whether what a calibration found can be true: signs of wrong data or of another robot."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.doubts.at_once import STEP_KINDS
from truearm.doubts.few_values import BETWEEN_THEM, few_values, values_words
from truearm.doubts.grids import BETWEEN, grid_steps, grid_words
from truearm.doubts.held_tool import TURN_MORE, held_tool, held_words
from truearm.doubts.one_anchor import ONE_ANCHOR
from truearm.doubts.outliers import NO_OUTLIERS, STATED_TOO_LARGE, Outliers, judged_means_mm
from truearm.doubts.what_to_check import CHECKS
from truearm.errors import Notice, count_of
from truearm.fits.core_set import Selection
from truearm.fits.details import ANOTHER_PLACE, VariableDetails
from truearm.fits.identified import IdentifiedArm
from truearm.fits.models import CONSTANT, NOMINAL, VARIABLE, ArmModel, leaves_noise
from truearm.fits.parameters import KIND_COUNT, are_lengths
from truearm.fits.stillness import still_warning
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.validation import FEW_HELD, Validation, mean_distance
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.outlier_fate import FULL_WEIGHT
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si

FAR_M: Final = 0.01
FAR_SHARE: Final = 2e-3
FAR_RAD: Final = 0.1
"""Lengths of arms are off by a millimetre or two, those of arms beyond some five metres by that much of each
metre; angles by milliradians, those of joints that were never mastered by a little more. Siblings of one
family differ by a centimetre and more."""
LARGE_MM: Final = 10.0
"""No arm that fits its table misses by so much once it is calibrated."""
LARGE_MRAD: Final = 50.0
"""Nor turns its tool by so much more or less."""
COMPUTED_MM: Final = 0.02
"""No real arm is where its nominal model has it to within this."""
NEAR_MM: Final = 0.5
"""Wrong data, or those of another arm, are never so near the nominal model."""
NOISY_MM: Final = 5.0
"""Nor so near, and as far off as noise alone leaves them."""
AS_THE_TABLE: Final = (
    "As far as these poses tell the arm is where its table has it: use the arm without a calibration, or "
    "measure more poses."
)
LIKE_NOISE: Final = 0.2
"""Part of what noise leaves by which a mean error may differ from it: that of some twenty rows does."""
MOST_NAMED: Final = 4
UPRIGHT: Final = (0.0, 0.0, 1.0)
SAME: Final = 0.97
"""Mean errors whose ratio is between it and one are as good as the same."""
SIGMA_FIRST: Final = "Correct first what the rows state as their sigma, and calibrate again."
UNLIKELY: Final = 0.5
"""Noise leaves no mean error of so small a part of its own."""
FEWEST_OF_LEVEL: Final = 5
"""Rows of a level of sigma that do not all come out at so small a part of their noise by chance: of five it
is one level in a thousand."""
ALIKE: Final = 2.0
"""Sigmas whose ratio is below it are of one level."""
SURE: Final = 2.0
"""Standard errors of the mean difference over poses beyond which one model does better than another."""
NO_HELP: Final = "no_help"
NO_GAIN: Final = "no_gain"
SINGLE_ROWS: Final = "single_rows"
ORIENTATION_MISFIT: Final = "orientation_misfit"
CONSTANT_BETTER: Final = "constant_better"
TOO_FEW_TO_TELL: Final = "too_few_to_tell"
ROWS_SHIFTED: Final = "rows_shifted"
FAR_FROM_NOMINAL: Final = "far_from_nominal"
FITS_OTHERWISE: Final = "fits_otherwise"
COMPUTED: Final = "computed"
OF_NO_USE: Final = (NO_HELP, NO_GAIN, SINGLE_ROWS, COMPUTED)
ANOTHER_FRAME: Final = "another_frame"
WOULD_FIT: Final = (ROWS_SHIFTED, FITS_OTHERWISE, ANOTHER_PLACE, ANOTHER_FRAME, *STEP_KINDS)
"""What the measurements would fit, where a calibration does not help."""
ON_A_GRID: Final = "on_a_grid"
FEW_VALUES: Final = "few_values"
HELD_TOOL: Final = "held_tool"
HIDING: Final = (FEW_VALUES, HELD_TOOL, ONE_ANCHOR)
"""What leaves a part of the errors out of held-out rows too; grids do as well."""


def doubts(
    arm: IdentifiedArm,
    models: Mapping[str, ArmModel],
    validation: Validation,
    best: str,
    floor_mm: float,
    outliers: Outliers = NO_OUTLIERS,
) -> list[Notice]:
    """What speaks against a calibration whose model `best` is used; noise would leave `floor_mm`."""
    means = judged_means_mm(validation, outliers)
    before, after = means[NOMINAL], means[best]
    if before < COMPUTED_MM:
        return [_computed(outliers)]
    what = f"mean error on {validation.judged} rows"
    return [
        *(
            _single_rows(validation, best, what, outliers)
            or no_help(before, after, what, floor_mm, outliers, best=best)
        ),
        *_turns_otherwise(validation, best, outliers),
        *_far_from_nominal(arm, [models[CONSTANT], models[best]]),
    ]


def stated_too_large(
    data: Measurements,
    validation: Validation,
    best: str,
    held: HeldRows | None,
    outliers: Outliers = NO_OUTLIERS,
) -> list[Notice]:
    """A warning where held-out rows, outliers left out, are far nearer than the noise that rows state lets
    them be.

    Args:
        data: All rows.
        validation: Errors of the models.
        best: The model that is used.
        held: The held-out rows, of which each level of sigma is judged; None where distances were judged.
        outliers: Rows that are far off, if any are known.
    """
    if data.sigma_m is None:
        return []
    stated = float(np.median(data.stated_sigma_m)) * MM_PER_METRE
    left = judged_means_mm(validation, outliers)[best]
    noise, apart = mean_distance(stated, distances=held is None), outliers.without
    if left > UNLIKELY * noise:
        return [] if held is None else _level_too_large(held.sigmas_mm(data), held, best, outliers)
    text = (
        f"The column of sigma typically says {length_mm(stated, 3)}, which alone would leave a mean error "
        f"of {length_mm(noise, 3)}; on {validation.judged} rows{apart} it is {length_mm(left, 3)}. So sigma "
        "is too large, and errors of the arm are taken for noise. Correct it (sigma is in m, sigma_mm in "
        "mm), or leave the column out."
    )
    return [Notice(STATED_TOO_LARGE, text)]


def _level_too_large(sigmas_mm: Floats, held: HeldRows, best: str, outliers: Outliers) -> list[Notice]:
    """The same of the largest sigma that enough held-out rows state (n,), if it is so."""
    errors = MM_PER_METRE * held.errors[best].distance_m
    judged = np.isfinite(errors) & held.without(outliers.entries)
    for level in reversed(_levels(np.where(judged, sigmas_mm, 0.0))):
        left, noise = float(errors[level].mean()), mean_distance(sigmas_mm[level].mean(), distances=False)
        if len(level) < FEWEST_OF_LEVEL or left > UNLIKELY * noise:
            continue
        ends = (length_mm(end, 3) for end in (sigmas_mm[level].min(), sigmas_mm[level].max()))
        text = (
            f"{count_of(len(level), 'held-out row')} of {len(held)} state a sigma of "
            f"{' to '.join(dict.fromkeys(ends))}, which alone would leave a mean error of "
            f"{length_mm(noise, 3)}; theirs is {length_mm(left, 3)}. So sigma is too large there: errors of "
            "the arm are taken for noise, and standard deviations may be too small. Correct it (sigma is in "
            "m, sigma_mm in mm), or leave the column out."
        )
        return [Notice(STATED_TOO_LARGE, text)]
    return []


def _levels(sigmas: Floats) -> list[NDArray[np.int64]]:
    """Rows by what they state (n,), ascending: places of those that are alike within ALIKE, zeros apart."""
    order = [int(k) for k in np.argsort(sigmas, kind="stable") if sigmas[k] > 0.0]
    levels: list[list[int]] = []
    for k in order:
        if not levels or sigmas[k] > ALIKE * sigmas[levels[-1][0]]:
            levels.append([])
        levels[-1].append(k)
    return [np.array(level, dtype=np.int64) for level in levels]


def constants_do_better(mean_mm: float, constant_mm: float) -> bool:
    """Whether a mean error is larger than that of constant parameters, by more than hardly anything."""
    return SAME * mean_mm > constant_mm


def constant_is_better(
    validation: Validation, best: str, held: HeldRows | None, outliers: Outliers = NO_OUTLIERS
) -> list[Notice]:
    """A notice where what varies was learnt and the constants alone are surely nearer, outliers left out.

    Few rows do not tell: a calibration that is fitted to all of them afterwards has learnt from so many more
    that it is often the nearer one then.
    """
    means = judged_means_mm(validation, outliers)
    if best in {NOMINAL, CONSTANT} or held is None or not helps(means[NOMINAL], means[best]):
        return []
    ahead, error = held.lead_mm(CONSTANT, best, outliers.entries)
    if not constants_do_better(means[best], means[CONSTANT]) or ahead <= SURE * error:
        return []
    apart = ", outliers left out" if outliers.means_mm else ""
    robust = " --robust cauchy" if best == VARIABLE and outliers.entries else ""
    against = f"a mean error of {length_mm(means[CONSTANT], 3)} against {length_mm(means[best], 3)}"
    if validation.n_holdout_poses < FEW_HELD:
        text = (
            f"Constant parameters were nearer on {validation.poses_judged}{apart}: {against}. So few do not "
            "tell which are nearer to the arm: measure more poses."
        )
        return [Notice(TOO_FEW_TO_TELL, text)]
    text = (
        f"Constant parameters do better on {validation.judged} rows{apart}: {against}. Give --model "
        f"constant{robust}, or measure more poses."
    )
    return [Notice(CONSTANT_BETTER, text)]


def orientations_left_out(data: Measurements, selection: Selection, use: str | None) -> list[Notice]:
    """A warning where orientations were measured and several targets are fitted in their place."""
    if use is not None or selection.orientation or data.orientations is None:
        return []
    count = int(data.oriented.sum())
    if not count:
        return []
    text = (
        f"Orientations of {count_of(count, 'row')} are left out: where rows hold several targets these are "
        "fitted, and tell of orientation as well. For orientations, and the first target alone: --use pose."
    )
    return [Notice("orientations_left_out", text)]


def mounting(variable: VariableDetails | None) -> list[Notice]:
    """A notice where the field, if there is one, takes another direction than the base's z axis for up."""
    up = UPRIGHT if variable is None else tuple(variable.hyper["up"])
    if up == UPRIGHT:
        return []
    shown = ", ".join(f"{part:.2g}" for part in up)
    text = (
        f"The errors grow with the levers of the links as if the direction ({shown}) of the base were "
        "vertical, not its z axis, and are calibrated so. If the arm is mounted on a wall or a slope, turn "
        "[base] in its file so that z points up: fewer poses then do. If it stands level, other errors "
        "look like that, and nothing needs to be done."
    )
    return [Notice("mounting", text)]


def poses_aside(aside: int, poses: int) -> list[Notice]:
    """A notice where some of the poses were judged but not fitted: others stood for them."""
    if not aside:
        return []
    text = (
        f"What varies was fitted to {poses - aside} of {poses} poses, which fill the space of the joints: it "
        "varies over such short distances that all of them are beyond what can be computed. The others were "
        "judged by it."
    )
    return [Notice("poses_aside", text)]


def stood_still(robot: Robot, readings: Floats) -> list[Notice]:
    """A warning where a joint has one reading in all rows of `readings` (n, N)."""
    text = still_warning(readings, robot.joints)
    return [Notice("stood_still", text)] if text else []


def seen_at_values(robot: Robot, readings: Floats) -> list[Notice]:
    """Warnings where readings (n, N) leave out what is between or beside them: it shows in no held-out pose.

    They stand on a grid, or at a few values, or hold the tool one way.
    """
    steps = grid_steps(readings, robot.joints)
    few = {k: own for k, own in few_values(readings, robot.joints).items() if k not in steps}
    return [*_on_a_grid(robot, steps), *_at_few_values(robot, few), *_held_one_way(robot, readings)]


def _on_a_grid(robot: Robot, steps: Mapping[int, float]) -> list[Notice]:
    if not steps:
        return []
    text = (
        f"The measured poses have {grid_words(steps, robot.joints)}. Errors that vary within a step, as "
        "gears and screws leave them, are not seen there, and held-out poses on the same grid do not show "
        f"them: between its values the arm may be further off than the errors say. {BETWEEN}."
    )
    return [Notice(ON_A_GRID, text)]


def _at_few_values(robot: Robot, values: Mapping[int, list[float]]) -> list[Notice]:
    if not values:
        return []
    text = (
        f"The measured poses have {values_words(values, robot.joints)} alone. What errors do in between "
        "was not measured, and held-out poses at the same values do not show it: there the arm may be "
        f"further off than errors and standard deviations say. {BETWEEN_THEM}."
    )
    return [Notice(FEW_VALUES, text)]


def _held_one_way(robot: Robot, readings: Floats) -> list[Notice]:
    held = held_tool(robot, readings)
    if held is None:
        return []
    text = (
        f"The measured poses have {held_words(held)}. What errors do where it is held otherwise was not "
        "measured, and held-out poses do not show it: there the arm may be further off than errors and "
        f"standard deviations say. {TURN_MORE}."
    )
    return [Notice(HELD_TOOL, text)]


def helps(before_mm: float, after_mm: float) -> bool:
    """Whether a calibration that leaves `after_mm` on average of `before_mm` is one to use."""
    return after_mm < min(SAME * before_mm, LARGE_MM)


def no_help(
    before_mm: float,
    after_mm: float,
    what: str,
    floor_mm: float,
    outliers: Outliers = NO_OUTLIERS,
    *,
    best: str = VARIABLE,
) -> list[Notice]:
    """A warning where a calibration is of no use.

    Args:
        before_mm: Error of the nominal model.
        after_mm: That of its own.
        what: What these are.
        floor_mm: What noise alone would leave on average.
        outliers: Rows that are far off, if any are known; those that are judged take no part in the errors.
        best: Name of its own model.
    """
    if helps(before_mm, after_mm):
        return []
    if nothing_to_gain(before_mm, after_mm, floor_mm):
        start, why = "There is nothing to gain", AS_THE_TABLE
        if outliers.stated_too_large:
            start, why = "The calibration gains nothing", SIGMA_FIRST
        elif outliers.named and outliers.fate == FULL_WEIGHT:
            start, why = "The calibration gains nothing", these_first(outliers)
        elif before_mm >= NEAR_MM and not leaves_noise(best):
            start, why = gains_nothing(best)
        elif before_mm >= NEAR_MM:
            why = (
                f"Noise alone would leave {length_mm(floor_mm, 4)}: what the arm errs by is hidden in it. "
                "Measure with a better instrument, each pose several times, or more poses."
            )
        text = (
            f"{start}: the {what}{outliers.without} is {length_mm(after_mm, 4)}, that of the nominal "
            f"model {length_mm(before_mm, 4)} already. {why}"
        )
        if outliers.means_mm and outliers.fate != FULL_WEIGHT:
            text += f" Correct the rows that are far off, or leave them out: {outliers.judged}."
        return [Notice(NO_GAIN, text)]
    text = (
        f"The calibration does not help: its {what}{outliers.without} is {length_mm(after_mm, 4)}, that of "
        f"the nominal model {length_mm(before_mm, 4)}. Do not use it until the reason is found. "
        f"{to_check(outliers)}"
    )
    return [Notice(NO_HELP, text)]


def gains_nothing(best: str) -> tuple[str, str]:
    """That a model gains nothing which takes what varies for noise, and what that may mean."""
    constants = best == CONSTANT
    return (
        "Constants gain nothing" if constants else f"The model {best} gains nothing",
        "What is left may be noise, or vary with the joints, which "
        f"{'constants cannot' if constants else 'it does not'} tell apart: calibrate with --model variable.",
    )


def to_check(outliers: Outliers) -> str:
    """What to look at where a calibration does not help: first rows that are far off, if any are."""
    if outliers.stated_too_large:
        return SIGMA_FIRST
    if outliers.exchanged:
        return "Put right first what is exchanged, or leave it out, and calibrate again."
    return f"{CHECKS}." if not outliers.named else f"{these_first(outliers)} {CHECKS}."


def these_first(outliers: Outliers) -> str:
    """That rows which are far off are to be looked at before anything else."""
    robust = ", and --robust cauchy gives hardly any weight" if outliers.fate == FULL_WEIGHT else ""
    return f"Look at these rows first, which alone may spoil the fit{robust}: {outliers.named}."


def nothing_to_gain(before_mm: float, after_mm: float, floor_mm: float) -> bool:
    """Whether a calibration does not help where data are hardly wrong.

    Both models miss by little, or by what noise alone would leave, `floor_mm`. Single rows that are far
    off make that larger than the mean error is.
    """
    if helps(before_mm, after_mm):
        return False
    errors = (before_mm, after_mm)
    like_noise = all(abs(error - floor_mm) <= LIKE_NOISE * floor_mm for error in errors)
    return max(errors) < NEAR_MM or (like_noise and max(errors) < NOISY_MM)


def _single_rows(validation: Validation, best: str, what: str, outliers: Outliers) -> list[Notice]:
    """A warning where a calibration helps but for single rows that are far off."""
    before_mm, after_mm = (validation.holdout[name].position.mean for name in (NOMINAL, best))
    if helps(before_mm, after_mm) or not outliers.means_mm:
        return []
    without, nominally = outliers.means_mm[best], outliers.means_mm[NOMINAL]
    if not helps(nominally, without):
        return []
    text = (
        f"Single rows are far off: {outliers.named}. With them the {what} is {length_mm(after_mm, 4)}, that "
        f"of the nominal model {length_mm(before_mm, 4)}; without them they are {length_mm(without, 4)} and "
        f"{length_mm(nominally, 4)}. Correct these rows or leave them out, and calibrate again."
    )
    return [Notice(SINGLE_ROWS, text)]


def _computed(outliers: Outliers) -> Notice:
    apart = f" but for {outliers.judged}" if outliers.means_mm else ""
    text = (
        f"The nominal arm has its target where these points are{apart}, within {COMPUTED_MM:g} mm: they seem "
        "to be what a controller computes from its joints, not what was measured. Nothing can be learnt from "
        "them. Give the points of an instrument that looks at the arm from outside."
    )
    return Notice(COMPUTED, text)


def _turns_otherwise(validation: Validation, best: str, outliers: Outliers) -> list[Notice]:
    """A warning where orientations do not fit, or all fit but those of single rows."""
    turned = validation.holdout[best].orientation
    if turned is None or turned.mean < LARGE_MRAD:
        return []
    without = outliers.means_mrad.get(best, turned.mean)
    if without < LARGE_MRAD:
        text = (
            f"Orientations of single rows are far off: {outliers.named}. With them their mean error on "
            f"{validation.judged} rows is {turned.mean:.4g} mrad, without them {without:.4g} mrad. "
            "Correct these rows or leave their orientations empty, and calibrate again."
        )
        return [Notice(SINGLE_ROWS, text)]
    turned_most = max((entry.get("turn_mrad", 0.0) for entry in outliers.entries), default=0.0)
    first = f"{these_first(outliers)} " if turned_most > LARGE_MRAD else ""
    text = (
        f"Orientations do not fit the arm: their mean error on {validation.judged} rows is "
        f"{turned.mean:.4g} mrad. {first}"
        "Check how they were noted (order of the quaternion, convention of Euler angles, into which frame "
        "they turn), or calibrate with positions alone: --use position."
    )
    return [Notice(ORIENTATION_MISFIT, text)]


def _far_from_nominal(arm: IdentifiedArm, models: Sequence[ArmModel]) -> list[Notice]:
    """A warning where parameters of one of the models, the farthest one, are too far from the table."""
    found = max((model.constants for model in models), key=lambda each: float(_share_of_far(arm, each).max()))
    nominal, share = arm.table, _share_of_far(arm, found)
    names = dict(zip(arm.candidates.columns, arm.candidates.names, strict=True))
    order = [int(k) for k in np.argsort(-share, axis=None) if share.flat[k] > 1.0 and int(k) in names]
    if not order:
        return []
    texts = [_from_to(names[k], k, nominal, found) for k in order[:MOST_NAMED]]
    rest = f" and {len(order) - MOST_NAMED} more" if len(order) > MOST_NAMED else ""
    text = (
        f"{', '.join(texts)}{rest}: no {arm.robot.name} deviates so far from its table. It is another robot, "
        "or the table or the data are wrong."
    )
    return [Notice(FAR_FROM_NOMINAL, text)]


def _share_of_far(arm: IdentifiedArm, found: Floats) -> Floats:
    """How far parameters (L, 5) are from the table, over what is too far; a base does not count."""
    length = are_lengths(range(KIND_COUNT))
    change = found - arm.table
    change[:, ~length] = np.arctan2(np.sin(change[:, ~length]), np.cos(change[:, ~length]))
    far_m = max(FAR_M, FAR_SHARE * float(np.abs(arm.robot.table[:, length]).sum()))
    share = np.abs(change) / np.where(length, far_m, FAR_RAD)
    if arm.world_is_known:
        share[0] = 0.0
    return share


def _from_to(name: str, place: int, nominal: Floats, found: Floats) -> str:
    unit = "mm" if are_lengths([place])[0] else "deg"
    before, after = (float(table.flat[place]) / to_si(1.0, unit) for table in (nominal, found))
    return f"{name} is {after:.1f} {unit} in place of the nominal {before:.1f}"
