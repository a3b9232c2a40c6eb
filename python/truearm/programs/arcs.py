"""Arcs: where they lead, how the tool turns on them, and which ones a program states."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from truearm.programs.tables import NOWHERE, Motion, Moves
from truearm.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from truearm.types import Floats
from truearm.units import FULL_TURN

FLAT: Final = 1e-5
"""Sine of the angle between chords of an arc below which its points count as in line."""
NEARLY_RAD: Final = np.deg2rad(3.0)
"""What half a turn may lack so that a tool may turn the other way round: ends are rounded, and corrected."""


class Arc:
    """An arc of a tool that turns evenly about one axis on the way.

    Attributes:
        length_m: How long it is.
        turn_rad: How far the tool turns.
    """

    def __init__(self, start: Floats, end: Floats, points: Floats) -> None:
        """From pose to pose (4, 4), on the circle that passes three points (3, 3) in this order, the first
        at the start: all around where it ends there.
        """
        first, second = points[1] - points[0], points[2] - points[0]
        normal = _cross(first, second)
        across = float(normal @ normal)
        to_centre = _cross(first @ first * second - second @ second * first, normal) / (2.0 * across)
        self._centre, self._arm = points[0] + to_centre, -to_centre
        self._axis = normal / np.sqrt(across)
        self._start = start
        self._angle_rad = self._angle_to(end[:3, 3]) or FULL_TURN
        self._turn = rotation_vector_from_matrix(start[:3, :3].T @ end[:3, :3])
        self.length_m = self._angle_rad * float(np.linalg.norm(self._arm))
        self.turn_rad = float(np.linalg.norm(self._turn))

    @classmethod
    def through(cls, start: Floats, vias: Sequence[Floats], end: Floats) -> "Arc | None":
        """Between poses (4, 4) of a tool past one or two others; None where they make none."""
        points = np.stack([pose[:3, 3] for pose in (start, *vias, end)[:3]])
        first, second = points[1] - points[0], points[2] - points[0]
        sizes = np.linalg.norm(first) * np.linalg.norm(second)
        curved = np.linalg.norm(_cross(first, second)) > FLAT * sizes
        return cls(start, end, points) if curved else None

    def _angle_to(self, point: Floats) -> float:
        """From the start to where a point (3,) is, along the arc, rad."""
        arm = point - self._centre
        angle = float(np.arctan2(self._axis @ _cross(self._arm, arm), self._arm @ arm))
        return 0.0 if abs(angle) < FLAT else angle % FULL_TURN

    def share_of(self, point: Floats) -> float:
        """The share of the way at which it passes a point (3,)."""
        return self._angle_to(point) / self._angle_rad

    def _gone(self, shares: Floats) -> Floats:
        """What turns the start's place into those at shares (n,) of the way, (n, 3, 3)."""
        return matrix_from_rotation_vector(shares[:, None] * self._angle_rad * self._axis)

    def poses(self, shares: Floats) -> Floats:
        """Poses (n, 4, 4) at shares (n,) of the way."""
        found = np.tile(np.eye(4), (len(shares), 1, 1))
        found[:, :3, 3] = self._centre + self._gone(shares) @ self._arm
        found[:, :3, :3] = self.turned(shares[:, None])
        return found

    def turned(self, share: float | Floats) -> Floats:
        """How the tool is turned at a share of the way, (3, 3), or at shares (n, 1), (n, 3, 3)."""
        return self._start[:3, :3] @ matrix_from_rotation_vector(share * self._turn)

    def turned_either_way(self, share: float) -> list[Floats]:
        """The same, (3, 3) each, both ways round where the tool turns by half a turn, or nearly."""
        found = [self.turned(share)]
        if self.turn_rad > np.pi - NEARLY_RAD:
            found.append(self._start[:3, :3] @ matrix_from_rotation_vector(share * _other_way(self._turn)))
        return found

    def turned_on_path(self, share: float) -> Floats:
        """The same where the tool turns evenly in a frame that goes round with the path.

        Of the two ways round that nearer to how it is turned otherwise: on half a circle and more between
        ends that are turned alike the tool does not spin.
        """
        back, gone = self._gone(np.array([-1.0, share]))
        turn = rotation_vector_from_matrix(self._start[:3, :3].T @ back @ self.turned(1.0))
        ways = [turn, _other_way(turn)] if turn.any() else [turn]
        found = [gone @ self._start[:3, :3] @ matrix_from_rotation_vector(share * way) for way in ways]
        even = self.turned_either_way(share)
        return min(found, key=lambda one: min(apart_rad(one, other) for other in even))

    def off_m(self, points: Floats) -> Floats:
        """How far points (n, 3) are from its circle, (n,)."""
        arms = points - self._centre
        beside = arms @ self._axis
        outside = np.linalg.norm(arms - beside[:, None] * self._axis, axis=1) - np.linalg.norm(self._arm)
        found: Floats = np.hypot(beside, outside)
        return found


def _cross(one: Floats, other: Floats) -> Floats:
    """The cross product of two vectors (3,); np.cross takes several times as long for a single one."""
    (a, b, c), (x, y, z) = one.tolist(), other.tolist()
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def _other_way(turn: Floats) -> Floats:
    """A rotation vector (3,), not zero, that ends where `turn` does, the other way round."""
    return turn * (1.0 - FULL_TURN / np.linalg.norm(turn))


def apart_rad(one: Floats, other: Floats) -> float:
    """The angle between two ways to be turned, (3, 3) each."""
    half_chord = np.linalg.norm(one - other) / np.sqrt(8.0)
    return 2.0 * float(np.arcsin(min(half_chord, 1.0)))


class StatedArc(NamedTuple):
    """An arc of a program, in numbers of moves.

    Attributes:
        before: The move to its start.
        vias: Those to what it passes, in their order.
        end: That to its end.
    """

    before: int
    vias: tuple[int, ...]
    end: int

    @property
    def all(self) -> tuple[int, ...]:
        """All of them, in their order."""
        return (self.before, *self.vias, self.end)


def stated_arcs(moves: Moves) -> list[StatedArc]:
    """The arcs past via points for which the program tells where they begin, what they pass and where they
    end.
    """
    moved = np.flatnonzero(moves.moving)
    motion, known = moves.motion[moved], moves.before[moved] != NOWHERE
    arcs = []
    for place in np.flatnonzero((motion == Motion.CIRCULAR) & known).tolist():
        first = place
        while first > 0 and known[first] and motion[first - 1] == Motion.VIA:
            first -= 1
        one_statement = bool((moves.at[moved[first:place]] == moves.at[moved[place]]).all())
        if 0 < first < place and known[first] and one_statement:
            arcs.append(
                StatedArc(int(moved[first - 1]), tuple(moved[first:place].tolist()), int(moved[place]))
            )
    return arcs
