"""Whether arm and instrument stood where they stood at first: the first contact, measured again."""

import json
from typing import Final, NamedTuple, NoReturn

import numpy as np

from truearm.cell.cell_file import ProcessSection
from truearm.cell.in_a_row import STEADY
from truearm.cell.scatter import explained_m, sigma_of_mean_m, weighted_mean
from truearm.cell.session import Session
from truearm.errors import Notice, WorkError, list_rows
from truearm.types import Floats
from truearm.units import MM_PER_METRE

DRIFT_MM: Final = "drift_mm"
"""In the head of a session: how far the first contact may have moved, mm."""
CONTRADICTED: Final = "no contact could be measured again: the readings of each contradict one another"
AT_THE_END: Final = (
    "Find what moves. truearm session export keeps apart what was measured since the last good check"
)
ON_THE_WAY: Final = (
    "Find what moves. Once it is in its place again the same command goes on; else measure the rest as a new "
    "session: a set-up of its own"
)
# Joined crosswise the tables are looked through in this order: the last check is found at their end and the
# first contact at their beginning, however long a session is.
UNCHECKED: Final = """
SELECT pose FROM outcomes JOIN steps USING (step)
WHERE kind = 'pose' AND outcome = 'measured' AND step > ?
AND step < (SELECT max(step) FROM outcomes JOIN steps USING (step) WHERE kind = 'check')
ORDER BY step
"""
CHECKS: Final = """
SELECT now.step, now.attempts, first.step, first.attempts
FROM outcomes AS now
CROSS JOIN steps AS checked USING (step)
CROSS JOIN outcomes AS first ON first.step = (
    SELECT outcomes.step FROM outcomes CROSS JOIN steps USING (step)
    WHERE outcome = 'measured' AND pose = checked.pose
    ORDER BY outcomes.step LIMIT 1
)
WHERE checked.kind = 'check' AND now.outcome = 'measured' AND first.step < now.step
ORDER BY now.step DESC LIMIT ?
"""


# Of each check of an unbroken row, up to one, that has readings: whether it has valid ones, and was skipped.
OF_ROW: Final = """
SELECT max(valid) AND outcome = 'skipped' FROM readings JOIN outcomes USING (step)
WHERE step <= :step AND step > (SELECT max(step) FROM steps WHERE kind != 'check' AND step < :step)
GROUP BY step
"""


class Check(NamedTuple):
    """A check that was measured.

    Attributes:
        step: Its step.
        first: The point (3,) of its pose as it was first measured, m.
        now: The point (3,) as the check found it, m.
        sigmas_m: Standard deviations of each coordinate of both, as the instrument states them, m.
    """

    step: int
    first: Floats
    now: Floats
    sigmas_m: tuple[float, float]

    @property
    def off_mm(self) -> float:
        """How far the pose has moved."""
        return float(MM_PER_METRE * np.linalg.norm(self.now - self.first))

    @property
    def explained_mm(self) -> float:
        """How far off it may be though nothing moved, by what the instrument states."""
        return MM_PER_METRE * explained_m(*self.sigmas_m)

    def has_moved(self, drift_mm: float) -> bool:
        """Whether it is farther off than it may be, mm, and than the instrument explains."""
        return self.off_mm > drift_mm and self.off_mm > self.explained_mm


def last_check(session: Session) -> Check | None:
    """The check that was measured last.

    None where there is none, or where its pose was not measured before: a contact for the frame may have been
    given up.
    """
    return next(iter(_checks(session, 1)), None)


def tells_nothing(session: Session, step: int) -> bool:
    """Whether the check that a step is was skipped, or is of a pose that was not measured before."""
    check = last_check(session)
    return check is None or check.step != step


def has_contradicted(session: Session, step: int) -> bool:
    """Whether each check of a row, up to a step, that has readings was given up though some are valid."""
    found = [contradicts for (contradicts,) in session.rows(OF_ROW, {"step": step})]
    return bool(found) and all(found)


def raise_if_moved(session: Session, drift_mm: float) -> None:
    """Raise if the last check of the first contact shows that something has moved.

    Args:
        session: The session.
        drift_mm: How far that contact may be off.
    """
    check = last_check(session)
    if check is None or not check.has_moved(drift_mm):
        return
    explained_mm = check.explained_mm
    beyond = f", and its readings explain {explained_mm:.2f} mm" if explained_mm > drift_mm else ""
    raise WorkError(
        f"the first contact is now {check.off_mm:.2f} mm from where it was",
        where="check",
        rule=f"The cell may drift by {drift_mm:g} mm (drift_mm){beyond}",
        way_out=AT_THE_END if session.next_step() is None else ON_THE_WAY,
    )


def raise_unsure(*, contradicted: bool) -> NoReturn:
    """Raise as no contact could be measured again, where that has to be known."""
    raise WorkError(
        CONTRADICTED if contradicted else "the first contact could not be measured again",
        where="check",
        rule="A session goes on where it finds arm and instrument in their places",
        way_out=f"{STEADY}. Then the same command goes on"
        if contradicted
        else "truearm session show tells why. Put that right, then the same command goes on",
    )


def unsure_steps(session: Session) -> list[range]:
    """Steps between a check that found the cell in its place, or the start, and the next one that did not.

    Something moved meanwhile: before, between or after them.
    """
    stated = session.meta(DRIFT_MM)
    limit_mm = ProcessSection().drift_mm if stated is None else float(stated)
    unsure, since = [], 0
    for check in reversed(_checks(session, -1)):
        if check.has_moved(limit_mm) and since < check.step:
            unsure.append(range(since, check.step))
        since = check.step + 1
    return unsure


def unchecked_poses(session: Session) -> list[int]:
    """Measured poses, from 1, behind the last check that told something and before one that told nothing.

    Where no contact could be measured again nothing says whether arm and instrument stood still meanwhile.
    """
    check = last_check(session)
    return [row[0] + 1 for row in session.rows(UNCHECKED, (-1 if check is None else check.step,))]


def told_unchecked(poses: list[int]) -> list[Notice]:
    """What is to be known of such poses, if there are any."""
    if not poses:
        return []
    return [
        Notice(
            "unchecked",
            f"{list_rows(poses, 'pose')}: nothing says whether something moved while they were measured, as "
            "no contact could be measured again behind them. Measure some of them once more, or plan poses "
            "that the arm can come back to.",
        )
    ]


def _checks(session: Session, most: int) -> list[Check]:
    """The last checks, as many at the most, the last first; all with -1."""
    found = []
    for step, attempts, first, attempts_then in session.rows(CHECKS, (most,)):
        then, then_sigma_m = _mean(session, first, attempts_then)
        now, now_sigma_m = _mean(session, step, attempts)
        found.append(Check(step, then, now, (then_sigma_m, now_sigma_m)))
    return found


def _mean(session: Session, step: int, attempts: str) -> tuple[Floats, float]:
    """Mean of the accepted points of a step, m, and its standard deviation in each coordinate, m."""
    accepted = json.loads(attempts)
    readings = [each for each in session.readings_of(step) if each.attempt in accepted]
    points = [each.point for each in readings if each.point is not None]
    sigmas_m = [each.sigma_m for each in readings if each.point is not None]
    return weighted_mean(points, sigmas_m), sigma_of_mean_m(sigmas_m)
