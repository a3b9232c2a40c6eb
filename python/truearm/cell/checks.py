"""Whether arm and instrument stood where they stood at first: the first contact, measured again."""

import json
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truearm.cell.cell_file import ProcessSection
from truearm.cell.session import Session
from truearm.errors import Notice, list_rows
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

DRIFT_MM: Final = "drift_mm"
"""In the head of a session: how far the first contact may have moved, mm."""
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


class Check(NamedTuple):
    """A check that was measured.

    Attributes:
        step: Its step.
        first: The point (3,) of its pose as it was first measured, m.
        now: The point (3,) as the check found it, m.
    """

    step: int
    first: Floats
    now: Floats

    @property
    def off_mm(self) -> float:
        """How far the pose has moved."""
        return float(MM_PER_METRE * np.linalg.norm(self.now - self.first))


def last_check(session: Session) -> Check | None:
    """The check that was measured last.

    None where there is none, or where its pose was not measured before: a contact for the frame may have been
    given up.
    """
    return next(iter(_checks(session, 1)), None)


def unsure_steps(session: Session) -> list[range]:
    """Steps between a check that found the cell in its place, or the start, and the next one that did not.

    Something moved meanwhile: before, between or after them.
    """
    stated = session.meta(DRIFT_MM)
    limit_mm = ProcessSection().drift_mm if stated is None else float(stated)
    unsure, since = [], 0
    for check in reversed(_checks(session, -1)):
        if check.off_mm > limit_mm and since < check.step:
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
    return [
        Check(step, _mean_point(session, first, attempts_then), _mean_point(session, step, attempts))
        for step, attempts, first, attempts_then in session.rows(CHECKS, (most,))
    ]


def _mean_point(session: Session, step: int, attempts: str) -> Floats:
    accepted = json.loads(attempts)
    points = [each.point for each in session.readings_of(step) if each.attempt in accepted]
    return np.asarray(np.mean([point for point in points if point is not None], axis=0))
