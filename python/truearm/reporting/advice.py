"""What would help most next, decided by rules from the data."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from truearm.doubts.at_once import SETUP_TURNED, STEP_KINDS
from truearm.doubts.few_judged import few_in_words, is_of_a_range
from truearm.doubts.grids import BETWEEN
from truearm.doubts.moved_words import JOINTS_MOVED, LINKS_GREW, SETUP_TURNING, UNUSED_COLUMN
from truearm.doubts.of_results import (
    CONSTANT_BETTER,
    FEW_VALUES,
    HELD_TOOL,
    HIDING,
    SAME,
    UNLIKELY,
    WOULD_FIT,
    to_check,
)
from truearm.doubts.one_anchor import ONE_ANCHOR
from truearm.doubts.outliers import EXCHANGED, NO_OUTLIERS, STATED_TOO_LARGE
from truearm.doubts.row_order import ORDER_OF_POSES
from truearm.doubts.uneven_axes import UNEVEN_AXES
from truearm.doubts.uneven_setups import UNEVEN_SETUPS, UNEVEN_TURNS
from truearm.errors import count_of, short_names
from truearm.fits.details import ANOTHER_PLACE
from truearm.fits.identifiability import BASE, SETUP
from truearm.fits.models import CONSTANT, VARIABLE, leaves_noise
from truearm.outlier_fate import FULL_WEIGHT
from truearm.reporting.distance_ways import has_all_ways
from truearm.reporting.facts import Facts
from truearm.reporting.known import Known, Stretch, weakest
from truearm.reporting.levers import ON_THE_AXIS_MM, taken_over, target_lever_mm
from truearm.reporting.numbers import fixed, listed, percent, short, shown_readings
from truearm.storage.summary import saw_orientations

MOST: Final = 4
AT_THE_FLOOR: Final = 1.25
"""A mean error within so many times what noise alone leaves has reached it."""
LENGTHS_SPREAD: Final = 0.42
"""Standard deviation of the length of a vector with three equal normal coordinates, over its mean."""
SURE: Final = 3.0
LEFT_IN_TRAINING: Final = 0.3
"""Share of the noise, squared, that a fit leaves in its own rows, below which noise may be told a quarter of
what it is: what varies has followed most of it.
"""
LONG_TAIL: Final = 5.0
"""The 99 % quantile over the mean: 2.1 where errors are normal and alike in all directions."""
COVERED: Final = 0.88
ROWS_NAMED: Final = 5


@dataclass(frozen=True)
class Advice:
    """What to do next.

    Attributes:
        kind: Short name for programs.
        name: A few words.
        words: A sentence or two.
        weight_mm: What it is about, in mm of mean error; the larger comes first.
    """

    kind: str
    name: str
    words: str
    weight_mm: float


def advise(facts: Facts, known: Known | None) -> list[Advice]:
    """What would help most, the most first, four at most."""
    found = [advice for rule in _rules(facts) for advice in rule(facts)]
    if known is not None and not (facts.is_of_no_help or facts.undecided):
        found += _where(facts, known)
    return sorted(found, key=lambda advice: -advice.weight_mm)[:MOST]


def _would_fit(facts: Facts) -> Iterator[Advice]:
    kinds = (kind for kind in WOULD_FIT if kind not in STEP_KINDS)
    for words in filter(None, map(facts.noticed, kinds)):
        yield Advice("would_fit", "Correct what does not fit.", words, np.inf)


def _gave_way(facts: Facts) -> Iterator[Advice]:
    # An instrument that was put elsewhere has turned as well, and nothing gave way.
    put_elsewhere = bool(facts.noticed(ANOTHER_PLACE))
    kinds = (kind for kind in STEP_KINDS if not (put_elsewhere and kind == SETUP_TURNED))
    for words in filter(None, map(facts.noticed, kinds)):
        yield Advice("gave_way", "Find what gave way.", words, np.inf)


def _exchanged(facts: Facts) -> Iterator[Advice]:
    if words := " ".join(filter(None, map(facts.noticed, EXCHANGED))):
        yield Advice("exchanged", "Put right what is exchanged.", words, np.inf)


def _refused(facts: Facts) -> Iterator[Advice]:
    if words := facts.mostly_refused:
        # Outliers that stay in a fit may bend it so far.
        bent = bool(facts.summary["outliers"]) and facts.outliers.fate == FULL_WEIGHT
        weight = facts.mean_mm() if bent else np.inf
        yield Advice("mostly_refused", "Compensation refuses most poses.", words, weight)


def _checks(facts: Facts) -> Iterator[Advice]:
    if any(_exchanged(facts)) or facts.noticed(STATED_TOO_LARGE):
        return
    has_reason = any(map(facts.noticed, WOULD_FIT))
    words = to_check(NO_OUTLIERS if has_reason else facts.outliers)
    yield Advice("find_the_reason", "Find out what is wrong.", words, 20.0 * facts.mean_mm())


def _undecided(facts: Facts) -> Iterator[Advice]:
    words = (
        f"{facts.undecided}: an error like that of the nominal model may be chance. Do not use it before it "
        "was judged on more."
    )
    yield Advice("more_poses", "Measure more poses.", words, 20.0 * facts.mean_mm())


def _outliers(facts: Facts) -> Iterator[Advice]:
    outliers = facts.summary["outliers"]
    if not outliers:
        return
    names = short_names(facts.files)
    of_file = {file: f" of {name}" if len(names) > 1 else "" for file, name in names.items()}
    named = [f"{entry['row']}{of_file[entry['file']]}" for entry in outliers[:ROWS_NAMED]]
    named += [f"{len(outliers) - ROWS_NAMED} more"] if len(outliers) > ROWS_NAMED else []
    rows = "row" if len(outliers) == 1 else "rows"
    sizes = _as_judged(facts, outliers)
    largest = [
        f"{short(max(entry[name] for entry in sizes if name in entry))[0]} {unit}"
        for name, unit in (("distance_mm", "mm"), ("turn_mrad", "mrad"))
        if any(name in entry for entry in sizes)
    ]
    share = sum(entry["distance_mm"] for entry in outliers) / facts.summary["n_fitted"]
    words = (
        f"{count_of(len(outliers), 'measurement')} cannot be of the arm that the others show: {rows} "
        f"{listed(named)}, up to {listed(largest)} off. Measure these poses again. Usual causes are an "
        "interrupted beam, a loose target, or an arm that had not settled."
    )
    yield Advice("outliers", "Check the outliers.", words, facts.mean_mm() + share)


def _as_judged(facts: Facts, outliers: list[dict[str, Any]]) -> list[Mapping[str, Any]]:
    """The outliers with what was missed there before they were seen, of those that were held out, as the
    verdict has them; with what the fit leaves of the others.
    """
    judged = [] if facts.held is None else facts.held.among(outliers, facts.best)
    named = {(entry["file"], entry["row"]): entry for entry in judged}
    return [named.get((entry["file"], entry["row"]), entry) for entry in outliers]


def _no_longer_fits(facts: Facts) -> Iterator[Advice]:
    if facts.update is not None and facts.update["verdict"] == "field" and not facts.changed_meanwhile:
        words = (
            f"{listed(facts.update['estimated']).capitalize()} do not explain what the update measured. "
            "Check that these are measurements of this arm. If they are, measure as many poses as it was "
            "calibrated from, and calibrate from these alone: older rows are of the arm as it was."
        )
        yield Advice("calibrate_anew", "Calibrate anew.", words, 10.0 * facts.mean_mm())


def _left_out(facts: Facts) -> Iterator[Advice]:
    if facts.update is not None and facts.update["outliers"]:
        rows = listed(list(map(str, facts.update["outliers"])))
        words = (
            f"The update left out row {rows}, which "
            "no other pose supports; the errors above are without them. Measure these poses again."
        )
        yield Advice("outliers", "Check the outliers.", words, 2.0 * facts.mean_mm())


def _stated_sigma(facts: Facts) -> Iterator[Advice]:
    if words := facts.noticed(STATED_TOO_LARGE):
        yield Advice(STATED_TOO_LARGE, "Correct the column of sigma.", words, 2.0 * facts.mean_mm())


def _noise_or_poses(facts: Facts) -> Iterator[Advice]:
    if not leaves_noise(facts.best) or facts.leaves_more_than_noise:
        return
    floor, mean = facts.floor_mm, facts.mean_mm()
    left, noise = short(mean, floor)
    if mean <= AT_THE_FLOOR * floor:
        if mean < _least_by_chance(facts) * floor or facts.grids or any(map(facts.noticed, HIDING)):
            return
        words = (
            f"The {facts.mean_error} is {left} mm, and noise alone would leave {noise} mm. More poses will "
            "hardly help: what is left is noise of the measuring device and what the arm does not repeat."
        )
        yield Advice("noise_floor", "The noise floor is reached.", words, floor)
        return
    trained = facts.calibration.validation.poses_trained
    unsure = (
        ", though so few poses hardly tell noise from what the model misses"
        if facts.train_mean_mm**2 < LEFT_IN_TRAINING * floor**2
        else ""
    )
    words = (
        f"The {facts.mean_error} is {left} mm, and noise alone would leave {noise} mm{unsure}. What is more "
        f"than noise is what {trained} leave undetermined. Poses like those of the task help most."
    )
    yield Advice("more_poses", "Measure more poses.", words, mean - floor)


def _least_by_chance(facts: Facts) -> float:
    """Part of the floor that the mean error reaches by chance.

    Below it the floor is too high, and tells nothing.
    """
    validation = facts.calibration.validation
    if not (validation.n_train_poses and validation.n_holdout_poses):
        return UNLIKELY
    per_pose = 1.0 / validation.n_train_poses + 1.0 / validation.n_holdout_poses
    return max(UNLIKELY, 1.0 - SURE * LENGTHS_SPREAD * float(np.sqrt(per_pose)))


def _warm_up(facts: Facts) -> Iterator[Advice]:
    drift = facts.calibration.validation.drift
    if drift is None or drift.other_places:
        return
    steady = facts.calibration.validation.holdout[facts.best].position.mean
    span, left_in = max(drift.moved_mm.values()), drift.left_in_mean_mm[facts.best]
    moved, left, mean = short(span, left_in, steady)
    words = (
        f"The set-up moved by {moved} mm while it was measured. That is known and taken out: the mean error "
        f"is {mean} mm, and {left} mm with it left in. Whether arm or measuring device moved, these data do "
        "not tell: "
    )
    if drift.slips:
        jumps = [(group, jump) for group, own in drift.slips.items() for jump in own]
        places = "; ".join(
            f"{group}, between {jump.between}, {short(jump.mm)[0]} mm" for group, jump in jumps
        )
        words += f"look at target, tripod and joints where it did so at once: {places}."
        yield Advice("gave_way", "Find what gave way.", words, left_in - steady)
        return
    words += "let both warm up before they are used, and measure a fixed point now and then."
    yield Advice("warm_up", "Let the set-up warm up.", words, left_in - steady)


def _unused_column(facts: Facts) -> Iterator[Advice]:
    if words := facts.noticed(UNUSED_COLUMN):
        yield Advice(UNUSED_COLUMN, "Calibrate with the column.", words, 2.0 * facts.mean_mm())


def _moved_meanwhile(facts: Facts) -> Iterator[Advice]:
    for words in filter(None, map(facts.noticed, (JOINTS_MOVED, LINKS_GREW))):
        yield Advice("joints_moved", "Let the arm warm up.", words, facts.mean_mm())
    if words := facts.noticed(SETUP_TURNING):
        yield Advice("setup_turning", "Let the device settle.", words, facts.mean_mm())


def _uneven(facts: Facts) -> Iterator[Advice]:
    # Outliers come first: without them there may be less to state.
    weight, told = facts.mean_mm() if facts.summary["outliers"] else 2.0 * facts.mean_mm(), facts.noticed
    for advice in (
        Advice(UNEVEN_SETUPS, "State sigma_mm.", told(UNEVEN_SETUPS), weight),
        Advice(UNEVEN_TURNS, "State sigma_mrad.", told(UNEVEN_TURNS), weight),
        Advice(UNEVEN_AXES, "State sigma_x_mm, sigma_y_mm, sigma_z_mm.", told(UNEVEN_AXES), weight),
    ):
        if advice.words:
            yield advice


def _stood_still(facts: Facts) -> Iterator[Advice]:
    if facts.still:
        yield Advice("joint_stood_still", "Move every joint.", facts.still, 10.0 * facts.mean_mm())


def _on_a_grid(facts: Facts) -> Iterator[Advice]:
    if facts.grids:
        words = (
            f"The measured poses have {facts.grids}: neither the calibration nor the errors "
            f"above know of what varies within a step. {BETWEEN}."
        )
        yield Advice("between_the_grid", "Measure between the grid's values.", words, facts.mean_mm())


def _at_few_values(facts: Facts) -> Iterator[Advice]:
    if words := facts.noticed(FEW_VALUES):
        yield Advice("between_few_values", "Measure in between.", words, facts.mean_mm())


def _held_one_way(facts: Facts) -> Iterator[Advice]:
    if words := facts.noticed(HELD_TOOL):
        yield Advice("turn_the_wrist", "Turn the wrist.", words, facts.mean_mm())


def _to_one_anchor(facts: Facts) -> Iterator[Advice]:
    if words := facts.noticed(ONE_ANCHOR):
        yield Advice(ONE_ANCHOR, "Measure to further points.", words, 2.0 * facts.mean_mm())


def _in_order(facts: Facts) -> Iterator[Advice]:
    if words := facts.noticed(ORDER_OF_POSES):
        yield Advice("another_order", "Measure in another order.", words, 0.5 * facts.mean_mm())


def _tail(facts: Facts) -> Iterator[Advice]:
    if facts.held is None:
        return
    mean, p99 = facts.mean_mm(), float(np.nanquantile(facts.kept_errors_mm(facts.best), 0.99))
    if p99 > LONG_TAIL * mean:
        far, near = short(p99, mean)
        words = (
            f"One pose in a hundred has an error above {far} mm; the {facts.mean_error} is {near} mm. See "
            "where the worst poses lie, in their table and along the joints: measure more poses there, or "
            "these again."
        )
        yield Advice("long_tail", "Look at the worst poses.", words, 0.5 * p99)


def _where(facts: Facts, known: Known) -> Iterator[Advice]:
    weak = weakest(facts, known)
    if weak is None:
        return
    std, median = short(weak.std_mm, weak.median_mm)
    words = (
        f"With {_range(facts, weak)} the standard deviation is {std} mm; its median over all configurations "
        f"is {median} mm. {_lying(facts, weak)} Measure there, or keep the task away."
    )
    yield Advice("more_poses_there", "Fill the gap.", words, 0.5 * (weak.std_mm - weak.median_mm))


def _lying(facts: Facts, weak: Stretch) -> str:
    """How many measured poses lie in a stretch."""
    if facts.readings is None:
        return "How many measured poses lie there is not known."
    if weak.rows == 0:
        return "No measured pose lies there."
    return f"{count_of(weak.rows, 'measured pose')} {'lies' if weak.rows == 1 else 'lie'} there."


def _range(facts: Facts, weak: Stretch) -> str:
    low, high = (
        shown_readings(facts.typical * 0.0 + end, facts.joints)[weak.joint] for end in (weak.low, weak.high)
    )
    return f"joint {weak.joint + 1} between {fixed(low, 0)} and {fixed(high, 0)} {facts.unit(weak.joint)}"


def _unseen(facts: Facts) -> Iterator[Advice]:
    found, selection = facts.calibration.identifiability, facts.calibration.selection
    pairs = zip(found.undetermined, found.words, strict=True)
    lever = target_lever_mm(facts)
    harmless = {name for name, words in pairs if SETUP in words or BASE in words} | taken_over(facts)
    hidden = [name for name in found.undetermined if name not in harmless]
    if hidden:
        is_on = lever is not None and lever < ON_THE_AXIS_MM
        more = ", and a target mounted off the last axis," if is_on else ""
        words = (
            f"The poses do not determine {listed(hidden)}: the nominal values stay. Larger motions of the "
            f"joints{more} would determine more."
        )
        yield Advice("unseen_parameters", "Determine all parameters.", words, 0.1 * facts.mean_mm())
    if selection.distances or selection.orientation or len(selection.targets) > 2:
        return
    words = "The orientation of the tool follows from positions alone, and nothing here validates it. "
    weight = 0.05 * facts.mean_mm()
    if saw_orientations(facts.calibration):
        words += "It was measured, and not used: calibrate with --use pose."
        yield Advice("orientation_not_used", "Use the orientations.", words, weight)
    else:
        words += (
            "If the tool is long or its direction matters, measure its orientation, or three targets on it."
        )
        yield Advice("no_orientation", "Measure orientation.", words, weight)


def _along_distances(facts: Facts) -> Iterator[Advice]:
    if facts.calibration.selection.distances and not facts.noticed(ONE_ANCHOR) and not has_all_ways(facts):
        words = (
            "These errors are of distances, one coordinate of where the point is; those of positions are "
            "larger. Distances to further fixed points, in other directions, tell more of them."
        )
        yield Advice("further_points", "Measure to further fixed points.", words, 0.05 * facts.mean_mm())


def _few_held(facts: Facts) -> Iterator[Advice]:
    words, weight = few_in_words(facts.calibration), 0.5 * facts.mean_mm()
    if not words:
        return
    if facts.update is not None:
        yield Advice("few_held_out", "Judge it on more poses.", words, weight)
    elif is_of_a_range(facts.calibration):
        yield Advice("few_held_out", "Hold out a larger share.", words, weight)
    else:
        yield Advice("few_held_out", "Hold out more poses.", words, weight)


def _intervals(facts: Facts) -> Iterator[Advice]:
    covered = facts.calibration.validation.coverage_95
    if covered is not None and covered < COVERED:
        words = (
            f"Only {percent(covered)} of the held-out coordinates lie within their 95 % intervals: the "
            "held-out poses are unlike the training poses, or something moved between them."
        )
        yield Advice("narrow_intervals", "Do not trust the intervals.", words, facts.mean_mm())


def _what_varies(facts: Facts) -> Iterator[Advice]:
    mean, constant = facts.mean_mm(), facts.mean_mm(CONSTANT)
    if facts.changed_meanwhile:
        return
    if facts.best == CONSTANT and not facts.calibration.selection.distances:
        words = "Here they are constant; --model variable shows how much they vary over the workspace."
        yield Advice("try_variable", "Let the parameters vary.", words, 0.5 * mean)
    elif facts.best not in (CONSTANT, VARIABLE):
        words = (
            "This is one of the paper's schemes; --model variable needs fewer poses, and gives standard "
            "deviations."
        )
        yield Advice("try_variable", "Try the variable model.", words, 0.5 * mean)
    elif words := facts.noticed(CONSTANT_BETTER):
        yield Advice(CONSTANT_BETTER, "Constant parameters do better.", words, mean)
    elif facts.best == VARIABLE and mean > SAME * constant:
        left, before = short(mean, constant)
        against = (
            f"the same {facts.mean_error} of {left} mm as constant parameters"
            if left == before
            else f"a {facts.mean_error} of {left} mm against {before} mm with constant parameters"
        )
        words = (
            f"The variable model gains little or nothing: {against}. They hardly vary, or the poses are too "
            "few to show it."
        )
        yield Advice("constant_suffices", "Constant parameters do as well.", words, 0.2 * mean)


RULES: Final = (
    _would_fit,
    _gave_way,
    _exchanged,
    _refused,
    _outliers,
    _stood_still,
    _warm_up,
    _moved_meanwhile,
    _unused_column,
    _uneven,
    _on_a_grid,
    _at_few_values,
    _held_one_way,
    _to_one_anchor,
    _in_order,
    _stated_sigma,
    _noise_or_poses,
    _tail,
    _unseen,
    _along_distances,
    _few_held,
    _intervals,
    _what_varies,
)
RULES_OF_UPDATES: Final = (_would_fit, _gave_way, _no_longer_fits, _refused, _left_out, _unseen, _few_held)
RULES_WITHOUT_HELP: Final = (_would_fit, _gave_way, _exchanged, _checks, _stood_still)
RULES_UNDECIDED: Final = (_undecided, _outliers, _stood_still, _few_held)


def _rules(facts: Facts) -> tuple[Callable[[Facts], Iterator[Advice]], ...]:
    """The rules that hold for a calibration.

    One that does not help tells nothing of noise or of the arm, nor does one of which nothing is known yet.
    """
    if facts.update is not None:
        return RULES_OF_UPDATES
    if facts.undecided:
        return RULES_UNDECIDED
    return RULES_WITHOUT_HELP if facts.is_of_no_help else RULES
