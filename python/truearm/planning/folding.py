"""A rule that keeps an arm out of itself: links that are not next to each other stay apart."""

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from truearm.kinds import check_values
from truearm.planning.accessibility import Places
from truearm.types import Floats, Mask

SHORTEST_LINK_M: Final = 1e-6
JOINED: Final = 2.0
"""Links with less than so many times their distance between them are taken to be next to each other."""


@dataclass(frozen=True)
class ClearOfItself:
    """Links that are not next to each other, the base column and the tool among them, do not meet.

    Links are capsules around the straight lines between their frames. Two of them are not looked at where the
    links between them are together shorter than four times the radius, as in a wrist or at an elbow: how near
    such links come is a matter of their build and of the joints' limits.

    Attributes:
        link_radius_m: Radius of every link.
    """

    link_radius_m: float

    holds_on_ways: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_values(self, not_negative=("link_radius_m",))

    def __call__(self, places: Places) -> Mask:
        """Of each pose."""
        corners, least = places.corners, 2.0 * self.link_radius_m
        begins, lines = corners[:, :-1], np.diff(corners, axis=1)
        lengths = np.linalg.norm(lines, axis=2)
        before = np.concatenate([np.zeros((len(corners), 1)), np.cumsum(lengths, axis=1)], axis=1)
        first, second = np.triu_indices(lines.shape[1], k=2)
        apart = before[:, second] - before[:, first + 1] > JOINED * least
        long = np.minimum(lengths[:, first], lengths[:, second]) > SHORTEST_LINK_M
        rows, pairs = np.nonzero(apart & long)
        one, other = first[pairs], second[pairs]
        gaps = _distance(begins[rows, one], lines[rows, one], begins[rows, other], lines[rows, other])
        clear = np.ones(len(corners), dtype=np.bool_)
        clear[rows[gaps < least]] = False
        return clear


def _distance(begin: Floats, line: Floats, other_begin: Floats, other_line: Floats) -> Floats:
    """Distances (n,) between straight pieces that begin at (n, 3) and go along lines (n, 3) of some length.

    After Ericson, Real-Time Collision Detection (2005), section 5.1.9: the nearest points of the endless
    lines, held to the ends of one piece after the other.
    """
    between = begin - other_begin
    a, e, b = _dot(line, line), _dot(other_line, other_line), _dot(line, other_line)
    c, f = _dot(line, between), _dot(other_line, between)
    slant = a * e - b * b
    parallel = slant <= np.finfo(np.float64).eps * a * e
    s = np.where(parallel, 0.0, np.clip((b * f - c * e) / np.where(parallel, 1.0, slant), 0.0, 1.0))
    t = np.clip((b * s + f) / e, 0.0, 1.0)
    s = np.clip((b * t - c) / a, 0.0, 1.0)
    return np.asarray(np.linalg.norm(between + s[:, None] * line - t[:, None] * other_line, axis=1))


def _dot(first: Floats, second: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", first, second))
