"""Whether the readings of a pose can be believed, from each other and from what was predicted."""

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

from truearm.cell.scatter import explained_m, weighted_mean
from truearm.cell.session import Point, Stored
from truearm.types import Floats

REPEATS_WHEN_SUSPICIOUS: Final = 1


class Verdict(NamedTuple):
    """What to do with a pose.

    Attributes:
        decision: "again", "accept" or "give up".
        attempts: The accepted readings, by attempt.
        reason: Why again, or why it is given up.
        suspicious: Whether the readings agree with each other but not with the prediction.
        off_m: How far the mean of those that agree is from the prediction; infinite where none is valid.
    """

    decision: Literal["again", "accept", "give up"]
    attempts: tuple[int, ...] = ()
    reason: str = ""
    suspicious: bool = False
    off_m: float = math.inf


NOTHING_YET: Final = Verdict("again")


class Rules(NamedTuple):
    """How readings are judged.

    Attributes:
        contacts: Readings that have to agree.
        attempts: How many are made at the most.
        agree_m: How far two readings of a pose may be apart; farther only as far as what both state as their
            standard deviations explains.
        likely_m: How far a reading may be from the prediction without being suspicious.
    """

    contacts: int
    attempts: int
    agree_m: float
    likely_m: float


def judge(readings: Sequence[Stored], expected: Floats, rules: Rules) -> Verdict:
    """Judge all readings of a pose so far.

    The largest set of readings that all agree with one another is accepted if it is large enough, and larger
    than all other readings together. Of several such sets only what all hold counts: a coarse reading, which
    agrees with two that contradict, speaks for neither. Where it is far from the prediction (3,), it has to
    have one reading more.
    """
    if not readings:
        return NOTHING_YET
    valid = [(reading, reading.point) for reading in readings if reading.valid and reading.point is not None]
    points = [point for _, point in valid]
    sigmas_m = [reading.sigma_m for reading, _ in valid]
    clusters, off_m = _largest_clusters(points, sigmas_m, rules.agree_m), math.inf
    held_by_all = frozenset.intersection(*clusters)
    agreeing = sorted(held_by_all or clusters[0])
    if agreeing:
        mean = weighted_mean([points[k] for k in agreeing], [sigmas_m[k] for k in agreeing])
        off_m = math.dist(mean, expected)
    far = bool(agreeing) and off_m > rules.likely_m
    needed = rules.contacts + (REPEATS_WHEN_SUSPICIOUS if far else 0)
    if len(held_by_all) >= needed and 2 * len(held_by_all) > len(points):
        return Verdict("accept", tuple(valid[k][0].attempt for k in agreeing), "", far, off_m)
    reason = _reason(len(readings), len(points), len(agreeing), far=far)
    return Verdict("again" if len(readings) < rules.attempts else "give up", (), reason, far, off_m)


def _largest_clusters(
    points: Sequence[Point], sigmas_m: Sequence[float], agree_m: float
) -> list[frozenset[int]]:
    """Numbers of the most points found that all agree with one another, of each such set.

    Beside each point, the nearest first, those are taken that agree with all taken before.
    """
    best = [frozenset[int]()]
    for centre in points:
        taken = set[int]()
        for k in sorted(range(len(points)), key=lambda k: math.dist(points[k], centre)):
            if all(
                math.dist(points[k], points[other]) <= max(agree_m, explained_m(sigmas_m[k], sigmas_m[other]))
                for other in taken
            ):
                taken.add(k)
        if len(taken) > len(best[0]):
            best = []
        if not best or len(taken) == len(best[0]):
            best.append(frozenset(taken))
    return best


def _reason(made: int, valid: int, agreeing: int, *, far: bool) -> str:
    if valid == 0:
        return f"no valid reading in {made}" if made else ""
    if agreeing < valid:
        return f"{valid} readings, of which {agreeing} agree"
    return "far from the prediction" if far else ""
