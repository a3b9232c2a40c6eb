"""What of an arm's results needs attention, and the verdict in one sentence."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from truearm.doubts.of_results import helps, nothing_to_gain
from truearm.fits.core_set import DISTANCE, POSITION
from truearm.fleet.fleet_file import LimitsSection, limit_key

Row = Mapping[str, Any]

GOOD: Final = "good"
ATTENTION: Final = "attention"
FAILED: Final = "failed"
MOST_MOVED_NAMED: Final = 3
STATISTICS: Final = {"mean": "Mean", "max": "Largest"}
ALIKE: Final = ("robot", "model", "errors_of")
PEERS: Final = 4
"""Arms of one kind that make a median to stand out from."""
STANDS_OUT: Final = 2.0
WORSE: Final = 2.0
"""Times the mean error of the last calibration."""
FEWEST_COVERED: Final = 0.85
MOST_OUTLIERS: Final = 0.02
HALF: Final = 0.5
LEAST_DECIMALS: Final = 3
MOST_DECIMALS: Final = 8


@dataclass(frozen=True)
class Reason:
    """Why an arm needs attention.

    Attributes:
        kind: One word for programs: "failed", "no_gain", "doubt", "drift", "mean", "max", "unjudged",
            "worse", "stands_out", "outliers" or "intervals".
        words: The sentence for people.
        weight: How far beyond its limit; those of one kind are sorted by it.
    """

    kind: str
    words: str
    weight: float = 1.0


KINDS: Final = (
    "failed",
    "no_gain",
    "doubt",
    "drift",
    "mean",
    "max",
    "unjudged",
    "worse",
    "stands_out",
    "outliers",
    "intervals",
)
"""The worst first."""


SPOILT: Final = ("drift", "mean", "max", "worse", "stands_out")
"""What a gross row can make of an arm that is as it was."""


def reasons(arm: Row, fleet: Sequence[Row], limits: LimitsSection) -> list[Reason]:
    """Why an arm needs attention, the worst first; nothing where it does not.

    Args:
        arm: Its row.
        fleet: Rows of all arms.
        limits: Of the fleet file.
    """
    if arm["status"] == FAILED:
        return [Reason("failed", f"{arm['error']}{_earlier(arm)}", np.inf)]
    found = [
        *_no_gain(arm),
        *_doubted(arm),
        *_drifted(arm, limits),
        *_beyond(arm, limits),
        *_unjudged(arm, limits),
        *_stands_out(arm, fleet),
    ]
    found += [*_worse(arm, limits), *_outliers(arm), *_intervals(arm)]
    return _with_outliers(arm, sorted(found, key=lambda reason: KINDS.index(reason.kind)))


def _earlier(arm: Row) -> str:
    """A sentence on the results of an earlier run, which a failed arm's directory still holds."""
    names = arm.get("earlier") or []
    return f" In its directory are results of an earlier run: {', '.join(names)}." if names else ""


def order(found: Sequence[Reason]) -> tuple[int, float]:
    """What arms are sorted by: those that need most attention first."""
    if not found:
        return len(KINDS), 0.0
    return KINDS.index(found[0].kind), -found[0].weight


def _no_gain(arm: Row) -> Iterator[Reason]:
    before, after = _mean_mm(arm, "nominal_"), _mean_mm(arm)
    if undecided := arm.get("undecided"):
        yield Reason("no_gain", undecided, after / before)
    elif not helps(before, after):
        none = nothing_to_gain(before, after, arm["floor_mm"])
        said = "There is nothing to gain" if none else "The calibration does not help"
        far = arm.get("outliers_named", "")
        if none and far:
            said = "The calibration gains nothing"
        look = f" Look at its outliers first: {far}." if far else ""
        words = f"{said}: its mean error is {after:.3f} mm, nominally {before:.3f} mm.{look}"
        yield Reason("no_gain", words, after / before)


def _mean_mm(arm: Row, model: str = "") -> float:
    """Mean error on held-out rows, outliers left out where these are known."""
    return float(arm.get(f"{model}without_outliers_mm", arm[f"{model}mean_mm"]))


def _doubted(arm: Row) -> Iterator[Reason]:
    """Notices that speak against data or table, or leave frame and target open."""
    yield from (Reason("doubt", words) for words in arm.get("grave", ()))


def _drifted(arm: Row, limits: LimitsSection) -> Iterator[Reason]:
    drift = arm["drift"]
    if drift is None:
        return
    is_sure = bool(drift["moved"]) or (drift["share_beyond"] or 0.0) > HALF
    change = f"{drift['mean_mm']:.3f} mm on average, {drift['max_mm']:.3f} mm at most"
    named = ", ".join(_change(entry) for entry in drift["moved"][:MOST_MOVED_NAMED])
    rest = len(drift["moved"]) - MOST_MOVED_NAMED
    moved = f" Moved: {named}{f' and {rest} more' if rest > 0 else ''}." if named else ""
    if limits.drift_mm is None:
        if is_sure:
            yield Reason("drift", f"Drift since the last calibration: {change}.{moved}", drift["mean_mm"])
    elif drift["mean_mm"] > limits.drift_mm:
        unsure = (
            "" if is_sure else " That is within the uncertainty of both calibrations: measure more poses."
        )
        words = f"Drift beyond {limits.drift_mm:g} mm: {change}.{moved}{unsure}"
        yield Reason("drift", words, drift["mean_mm"])


def _change(entry: Row) -> str:
    return f"{entry['name']} by {entry['change']:+.3f} {entry['unit']}"


def _beyond(arm: Row, limits: LimitsSection) -> Iterator[Reason]:
    for kind, noun in STATISTICS.items():
        value, limit = arm[f"{kind}_mm"], limits.of(kind, arm["errors_of"])
        if limit is not None and value > limit:
            words = f"{noun} {_error(arm)} {_above(value, limit)} mm on held-out rows, beyond {limit:g} mm."
            yield Reason(kind, words, value / limit)


def _unjudged(arm: Row, limits: LimitsSection) -> Iterator[Reason]:
    """Limits of position errors where distances were measured, which see one coordinate of them."""
    if arm["errors_of"] != DISTANCE:
        return
    stated = [name for name in STATISTICS if limits.of(name, POSITION) is not None]
    open_ones = [name for name in stated if limits.of(name, DISTANCE) is None]
    if open_ones:
        keys, own = (" and ".join(limit_key(name, of) for name in open_ones) for of in (POSITION, DISTANCE))
        words = (
            f"Position errors, which {keys} would limit, were not measured: distances were, whose errors are "
            f"smaller. State {own} too, or measure points."
        )
        yield Reason("unjudged", words)


def _error(arm: Row) -> str:
    """What the errors of an arm are called."""
    return "distance error" if arm["errors_of"] == DISTANCE else "error"


def _worse(arm: Row, limits: LimitsSection) -> Iterator[Reason]:
    """Against the last calibration, if its errors were of the same kind; where a limit of the mean is stated,
    that says what matters.
    """
    drift = arm["drift"] or {}
    was = drift.get("previous_mean_mm")
    if was is None or drift["previous_errors_of"] != arm["errors_of"]:
        return
    if limits.of("mean", arm["errors_of"]) is None and (mean := _mean_mm(arm)) > WORSE * was:
        words = f"Mean {_error(arm)} {mean:.3f} mm on held-out rows: it was {was:.3f} mm."
        yield Reason("worse", words, mean / was)


def _above(value: float, limit: float) -> str:
    """A value with as many decimals as show that it is above a limit, three at least."""
    texts = (f"{value:.{decimals}f}" for decimals in range(LEAST_DECIMALS, MOST_DECIMALS))
    return next((text for text in texts if float(text) > limit), repr(value))


def _stands_out(arm: Row, fleet: Sequence[Row]) -> Iterator[Reason]:
    """Against the arms of its kind that were calibrated and judged in the same way."""
    alike = [
        _mean_mm(other)
        for other in fleet
        if other["status"] != FAILED and all(other[key] == arm[key] for key in ALIKE)
    ]
    if len(alike) < PEERS:
        return
    ratio = _mean_mm(arm) / float(np.median(alike))
    if ratio > STANDS_OUT:
        of = f"the fleet's {len(alike)} {arm['robot']} arms"
        words = f"Mean {_error(arm)} {ratio:.1f} times the median of {of}."
        yield Reason("stands_out", words, ratio)


def _outliers(arm: Row) -> Iterator[Reason]:
    share = arm["outliers"] / arm["rows"]
    if share > MOST_OUTLIERS:
        yield Reason("outliers", _outlier_words(arm), share)


def _outlier_words(arm: Row) -> str:
    named = f": {arm['outliers_named']}" if arm.get("outliers_named") else ""
    are = "is an outlier" if arm["outliers"] == 1 else "are outliers"
    return f"{arm['outliers']} of {arm['rows']} rows {are}{named}."


def _with_outliers(arm: Row, found: list[Reason]) -> list[Reason]:
    """Outliers too few for a reason of their own, told with the first of the errors that they may make."""
    if not arm["outliers"] or any(reason.kind == "outliers" for reason in found):
        return found
    place = next((k for k, reason in enumerate(found) if reason.kind in SPOILT), None)
    if place is not None:
        spoilt = found[place]
        found[place] = replace(spoilt, words=f"{spoilt.words} {_outlier_words(arm)}")
    return found


def _intervals(arm: Row) -> Iterator[Reason]:
    covered = arm["coverage_95"]
    if covered is not None and covered < FEWEST_COVERED:
        words = f"The 95 % intervals hold {100 * covered:.0f} % of the held-out coordinates only."
        yield Reason("intervals", words, 1.0 / max(covered, 1e-3))
