"""Standard Denavit-Hartenberg rows for any serial arm, from its joint axes.

Frame i - 1 of a Denavit-Hartenberg chain has its z on the axis of joint i. Given the axes with all
joints at zero, each row follows from the next axis seen in the frame before it: by the common normal,
or, where the two axes are parallel within :data:`PARALLEL_RAD` and the common normal may lie anywhere,
by the point where the next axis crosses the frame's x-y plane and Hayati's alpha and beta. Both are
exact: nothing is rounded to a neighbouring simpler arm.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from truearm.description.dh_row import row_transform
from truearm.rotations import rigid_inverse
from truearm.types import Floats

PARALLEL_RAD: Final = 0.01
"""Below this the common normal is more than a hundred offsets away: alpha and beta describe it better."""
SAME_DIRECTION: Final = 1e-12
SAME_POINT_M: Final = 1e-12


@dataclass(frozen=True)
class Axis:
    """The axis of a joint with all joints at zero.

    Attributes:
        kind: "revolute" or "prismatic".
        point_in_base: A point on it (3,), m.
        direction_in_base: Unit vector (3,) of positive motion.
    """

    kind: Literal["revolute", "prismatic"]
    point_in_base: Floats
    direction_in_base: Floats


def dh_from_axes(axes: Sequence[Axis], base_from_tip: Floats) -> tuple[Floats, Floats, Floats]:
    """Fixed base transform, rows and fixed flange transform of an arm.

    Args:
        axes: The N axes, base to tip.
        base_from_tip: Transform (4, 4) with all joints at zero.

    Returns:
        base (4, 4), table (N, 5) with theta, d, a, alpha, beta in rad and m, flange (4, 4), such that
        base . A1 ... AN . flange is the arm's pose at any joint values.
    """
    base = _first_frame(axes[0])
    frame, rows = base, []
    for axis in axes[1:]:
        rows.append(_row(frame, axis.point_in_base, axis.direction_in_base, keeps_point=False))
        frame = frame @ row_transform(rows[-1], "standard")
    rows.append(_row(frame, base_from_tip[:3, 3], base_from_tip[:3, 2], keeps_point=True))
    frame = frame @ row_transform(rows[-1], "standard")
    return base, np.array(rows), rigid_inverse(frame) @ base_from_tip


def _first_frame(axis: Axis) -> Floats:
    """Frame on the first axis nearest to the base's origin, its x as near to the base's as can be."""
    z = axis.direction_in_base
    origin = axis.point_in_base - (axis.point_in_base @ z) * z
    start = np.eye(3)[0 if abs(z[0]) < math.sqrt(0.5) else 1]
    x = start - (start @ z) * z
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    frame[:3, 3] = origin
    return frame


def _row(frame: Floats, point_in_base: Floats, direction: Floats, *, keeps_point: bool) -> Floats:
    """Row (5,) that takes z of `frame` to the line through a point.

    `keeps_point` puts the origin at the height of that point where the axes are parallel, so that
    nothing but a rotation is left for the transform behind; else at the height of `frame`.
    """
    point = frame[:3, :3].T @ (point_in_base - frame[:3, 3])
    u = frame[:3, :3].T @ direction
    if math.hypot(u[0], u[1]) > PARALLEL_RAD:
        return _by_common_normal(point, u)
    return _by_crossing(point, u, height=float(point[2]) if keeps_point else 0.0)


def _by_common_normal(point: Floats, u: Floats) -> Floats:
    sine = math.hypot(u[0], u[1])
    along = np.array([u[0], u[1]]) / sine
    normal = np.array([-along[1], along[0]])
    theta = math.atan2(normal[1], normal[0])
    if _is_behind(theta):
        normal, theta = -normal, math.atan2(-normal[1], -normal[0])
    d = point[2] - (point[:2] @ along) / sine * u[2]
    a = float(point[:2] @ normal)
    alpha = math.atan2(normal[0] * -u[1] + normal[1] * u[0], u[2])
    return np.array([theta, d, a, alpha, 0.0])


def _by_crossing(point: Floats, u: Floats, height: float) -> Floats:
    crossing = point[:2] + (height - point[2]) / u[2] * u[:2]
    a, theta = math.hypot(*crossing), 0.0
    if a > SAME_POINT_M:
        theta = math.atan2(crossing[1], crossing[0])
        if _is_behind(theta):
            a, theta = -a, math.atan2(-crossing[1], -crossing[0])
    cosine, sine = math.cos(theta), math.sin(theta)
    ux, uy = cosine * u[0] + sine * u[1], cosine * u[1] - sine * u[0]
    if math.hypot(ux, uy) < SAME_DIRECTION:
        ux = uy = 0.0
    alpha = math.atan2(-uy, u[2]) if uy else (0.0 if u[2] > 0.0 else math.pi)
    return np.array([theta, height, a, alpha, math.asin(ux)])


def _is_behind(theta: float) -> bool:
    """Whether x points backwards: then the other end of the normal makes the smaller angle."""
    return abs(theta) > math.pi / 2 + 1e-9
