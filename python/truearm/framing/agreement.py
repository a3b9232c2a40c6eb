"""Whether touches agree with each other, and which of them do not."""

from typing import Final

import numpy as np
from scipy.special import fdtri

from truearm.errors import InputError, Notice, WorkError, list_rows
from truearm.lengths import length_mm
from truearm.registration import register
from truearm.rows.leaving_out import left_out
from truearm.types import Floats, Rows
from truearm.units import MM_PER_METRE

CHANCE: Final = 1e-3
"""That a row is named although all are as good as each other."""
WORST_M: Final = 0.01
"""What leaves more than this is no touch of one thing."""
BY_EYE_M: Final = 1e-4
"""How good touching by eye is."""
TWICE: Final = 2.0
MUCH_BETTER: Final = 0.2
UNIT_FACTOR: Final = (500.0, 2000.0)


def far_rows(residuals: Floats, jacobian: Floats, rows: Rows) -> list[Notice]:
    """A notice of the rows that the others contradict, if there are any.

    Each row is judged by what the others say of it, the farthest is taken out, and so on: a row that is far
    off spoils a fit to all of them, and with it every residual. The judge is the F statistic of leaving a row
    out (Cook and Weisberg, Residuals and Influence in Regression, 1982, section 2.2).

    Args:
        residuals: What each row leaves (n, 3), m.
        jacobian: Derivatives of what each row says by the p unknowns (n, 3, p).
        rows: Number of each row in its file (n,).
    """
    kept, far = np.ones(len(rows), dtype=np.bool_), {}
    while True:
        place, distance = _farthest(residuals[kept], jacobian[kept], CHANCE / len(rows))
        if place is None:
            break
        number = int(np.flatnonzero(kept)[place])
        kept[number], far[number] = False, distance
    if not far:
        return []
    numbers = [int(rows[place]) for place in sorted(far)]
    lie, them = ("lies", "it") if len(far) == 1 else ("lie", "them")
    text = (
        f"{list_rows(numbers)} {lie} far off, {length_mm(max(far.values()) * MM_PER_METRE, 3)} from where "
        f"the other rows say: look at {them}, or leave {them} out"
    )
    return [Notice("far_rows", text, tuple(numbers))]


def _farthest(residuals: Floats, jacobian: Floats, chance: float) -> tuple[int | None, float]:
    """The row that the others contradict most and by how much, m; None where they contradict none."""
    found = left_out(residuals, jacobian)
    freedom = 3 * len(residuals) - found.rank
    if freedom <= 3:
        return None, 0.0
    gained = np.square(found.lengths)
    place = int(gained.argmax())
    others = max(found.squares - float(gained[place]), 0.0) / (freedom - 3)
    if gained[place] / 3.0 <= fdtri(3, freedom - 3, 1.0 - chance) * others:
        return None, 0.0
    return place, float(np.linalg.norm(found.alone[place]))


def check_agreement(noise_m: float, notices: list[Notice]) -> None:
    """Raise WorkError where rows leave more than any touch or device does."""
    if noise_m <= WORST_M:
        return
    named = "; ".join(notice.message for notice in notices)
    raise WorkError(
        f"the rows disagree by {length_mm(noise_m * MM_PER_METRE, 4)} (standard deviation of a coordinate)",
        rule=f"Beyond {WORST_M * MM_PER_METRE:g} mm nothing is found from them",
        way_out=f"{named[0].upper()}{named[1:]}"
        if named
        else "Check the units and the order of columns and rows, and that the tool is the one that touched",
    )


def check_places(touched: Floats, places: Floats) -> None:
    """Check that touched points (n, 3) can be those whose places on an object (n, 3) are stated.

    Raises:
        InputError: If the places are in another unit.
        WorkError: If they are those of the object's mirror image.
    """
    seen, stated = _size(touched), _size(places)
    if not stated / TWICE < seen < stated * TWICE:
        raise InputError(
            f"the touched points lie {seen:.4g} m from their middle, their stated places {stated:.4g} m",
            rule="Places are in metres unless their columns say so (x_mm)",
            way_out=_way_out_of(seen, stated),
        )
    plain, mirrored = _misfit(touched, places), _misfit(touched, places * [1.0, 1.0, -1.0])
    if mirrored < MUCH_BETTER * plain:
        raise WorkError(
            f"the touched points fit their places to {length_mm(plain * MM_PER_METRE, 3)}, "
            f"and their mirror image to {length_mm(mirrored * MM_PER_METRE, 3)}",
            rule="The axes x, y and z of an object are right-handed",
            way_out="Check the signs and the order of x, y and z, and which point each row touched",
        )


def tell_handedness(touched: Floats, places: Floats) -> bool:
    """Whether touched points (n, 3) fit their places on an object (n, 3) better than its mirror image's.

    Those of one plane do not: turned over, its mirror image is the same there.
    """
    plain, mirrored = _misfit(touched, places), _misfit(touched, places * [1.0, 1.0, -1.0])
    return plain < MUCH_BETTER * mirrored and mirrored > BY_EYE_M


def _size(points: Floats) -> float:
    """Root mean square distance of points (n, 3) from their middle."""
    return float(np.sqrt(np.square(points - points.mean(axis=0)).sum(axis=1).mean()))


def _misfit(touched: Floats, places: Floats) -> float:
    """Root mean square of the residuals that a rigid motion of the places leaves."""
    none = np.empty((0, 3, 3))
    moved = register(places, touched, none, none, 0.0)
    return float(np.sqrt(np.square(touched - places @ moved[:3, :3].T - moved[:3, 3]).mean()))


def _way_out_of(seen: float, stated: float) -> str:
    low, high = UNIT_FACTOR
    if low * seen < stated < high * seen:
        return "If these are millimetres, give --length-unit mm, or name the columns x_mm, y_mm, z_mm"
    if low * stated < seen < high * stated:
        return "If these are metres, give --length-unit m, or name the columns x, y, z"
    return (
        "Check the columns and their units, those of joints too (q1 is in radians, q1_deg in degrees), and "
        "that each row's place belongs to the point it touched"
    )
