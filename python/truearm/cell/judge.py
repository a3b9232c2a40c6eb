"""Whether the readings of a pose can be believed, from each other and from what was predicted."""

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truearm.cell.scatter import explained_m
from truearm.cell.session import Point, Stored

Floats = NDArray[np.float64]

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
        agree_m: How far readings of a pose may be from one of them; farther only as far as what they state
            as their standard deviations explains.
        likely_m: How far a reading may be from the prediction without being suspicious.
    """

    contacts: int
    attempts: int
    agree_m: float
    likely_m: float


def judge(readings: Sequence[Stored], expected: Floats, rules: Rules) -> Verdict:
    """Judge all readings of a pose so far.

    The largest set of readings that agree with one of them is accepted if it is large enough, and larger than
    all readings that contradict it together. Where it is far from the prediction (3,), it has to have one
    reading more.
    """
    if not readings:
        return NOTHING_YET
    valid = [(reading, reading.point) for reading in readings if reading.valid and reading.point is not None]
    points = [point for _, point in valid]
    agreeing = _largest_cluster(points, [reading.sigma_m for reading, _ in valid], rules.agree_m)
    mean = mean_point([points[k] for k in agreeing]) if agreeing else None
    off_m = math.inf if mean is None else math.dist(mean, expected.tolist())
    far = mean is not None and off_m > rules.likely_m
    needed = rules.contacts + (REPEATS_WHEN_SUSPICIOUS if far else 0)
    if len(agreeing) >= needed and 2 * len(agreeing) > len(points):
        return Verdict("accept", tuple(valid[k][0].attempt for k in agreeing), "", far, off_m)
    reason = _reason(len(readings), len(points), len(agreeing), far=far)
    return Verdict("again" if len(readings) < rules.attempts else "give up", (), reason, far, off_m)


def mean_point(points: Sequence[Point]) -> Point:
    """The mean of points."""
    return tuple([math.fsum(column) / len(points) for column in zip(*points, strict=True)])


def _largest_cluster(points: Sequence[Point], sigmas_m: Sequence[float], agree_m: float) -> list[int]:
    """Numbers of the most points that all agree with one of them, the first such."""
    best: list[int] = []
    for centre, sigma_m in zip(points, sigmas_m, strict=True):
        near = [
            k
            for k, (point, own_m) in enumerate(zip(points, sigmas_m, strict=True))
            if math.dist(point, centre) <= max(agree_m, explained_m(sigma_m, own_m))
        ]
        if len(near) > len(best):
            best = near
    return best


def _reason(made: int, valid: int, agreeing: int, *, far: bool) -> str:
    if valid == 0:
        return f"no valid reading in {made}" if made else ""
    if agreeing < valid:
        return f"{valid} readings, of which {agreeing} agree"
    return "far from the prediction" if far else ""
