"""Contacts for the frame that were given up, and are measured again before the frame is."""

from typing import Final

from truearm.cell.in_a_row import TAKEN_BACK
from truearm.cell.registering import LEAST_POSES
from truearm.cell.session import Session

LEFT: Final = (
    "SELECT 1 FROM steps LEFT JOIN outcomes USING (step) "
    "WHERE kind = 'registration' AND outcome IS NULL LIMIT 1"
)
CONTACTS: Final = (
    "SELECT step FROM steps JOIN outcomes USING (step) "
    "WHERE kind = 'registration' AND outcome = ? ORDER BY step"
)


def contacts_left(session: Session) -> bool:
    """Whether a contact for the frame has no outcome yet."""
    return bool(session.rows(LEFT))


def take_contacts_back(session: Session) -> bool:
    """Have contacts measured again where too few succeeded for a frame; whether that is so.

    What was measured behind the first that was skipped is measured again as well.
    """
    measured, skipped = ([step for (step,) in session.rows(CONTACTS, (x,))] for x in ("measured", "skipped"))
    if len(measured) >= LEAST_POSES or not skipped:
        return False
    what = f"{len(measured)} contacts for the frame had succeeded: those that had not are measured again"
    session.take_back(skipped, TAKEN_BACK, what)
    return True
