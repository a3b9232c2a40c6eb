"""What is seen over several poses: nothing to believe, far from predictions, or the same point again."""

import math
from dataclasses import replace
from typing import Final

from truearm.cell.reading import Reading
from truearm.cell.session import Session, Step
from truearm.errors import WorkError
from truearm.types import Floats

UNMEASURED_IN_A_ROW: Final = 5
FAR_IN_A_ROW: Final = 3
TAKEN_BACK: Final = "taken back"
"""Kind of the event at each of the steps that were taken back."""
TAKEN_BACK_BEFORE: Final = "SELECT 1 FROM events WHERE kind = ? AND step BETWEEN ? AND ? LIMIT 1"
LAST_REASON: Final = (
    "SELECT reason FROM readings WHERE step <= ? AND reason != '' ORDER BY step DESC, attempt DESC LIMIT 1"
)
LAST_OUTCOME: Final = "SELECT reason FROM outcomes WHERE step = ?"
REPEATED: Final = "it repeats, to the last digit, the point of another pose"
NOUNS: Final = {"registration": "contacts for the frame", "pose": "poses"}
STEADY: Final = (
    "See whether target, arm and instrument are steady, and whether readings of a pose can agree to agree_mm"
)
SEE_TO: Final = {False: "See to the target and the line of sight", True: STEADY}
"""What to do, where no reading was valid, and where some were."""
WAYS_OUT: Final = {
    "registration": "{see_to}, and to [world] in the cell file. Then the same command measures these "
    "contacts again. With another [target] name a new session with -o",
    "pose": "{see_to}. Then the same command measures these poses again, and skips those that it cannot "
    "measure then either",
}


class Unmeasured:
    """Poses in a row that were given up: no reading was valid, or those that were contradict each other.

    One of them may be hidden, or unsteady; many say that the target is lost, or that the instrument cannot be
    believed, and would use up all that are left. Checks that are given up, and poses that a device refuses,
    are no part of such a row and do not end it.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._kind, self._seen = "", False
        self._steps: list[int] = []

    def measured(self) -> None:
        """A step was measured."""
        self._steps.clear()

    def given_up(self, step: Step, *, seen: bool) -> None:
        """A step was given up, with valid readings or without (`seen`).

        Where it is the fifth in a row, their outcomes and readings are taken out of the session, which goes
        on at the first of them. Poses of which one was taken back before stay skipped, and counting begins
        anew.

        Raises:
            WorkError: If they were taken out.
        """
        if step.kind not in NOUNS:
            return
        if step.kind != self._kind:
            self._kind, self._steps = step.kind, []
        self._seen = seen or (self._seen and bool(self._steps))
        self._steps.append(step.step)
        if len(self._steps) < UNMEASURED_IN_A_ROW:
            return
        what = f"{UNMEASURED_IN_A_ROW} {NOUNS[step.kind]} in a row {self._told(step)}"
        if self.take_back(what):
            raise WorkError(
                what, where=step.kind, way_out=WAYS_OUT[step.kind].format(see_to=SEE_TO[self._seen])
            )

    def take_back(self, what: str) -> bool:
        """Take the steps of the row as it is out of the session, for the reason `what`; whether that is done.

        Poses of which one was taken back before stay skipped. Counting begins anew.
        """
        steps, self._steps = self._steps, []
        if not steps:
            return False
        before = self._session.rows(TAKEN_BACK_BEFORE, (TAKEN_BACK, steps[0], steps[-1]))
        if before and self._kind == "pose":
            return False
        self._session.take_back(steps, TAKEN_BACK, what)
        return True

    def _told(self, last: Step) -> str:
        """What became of the steps, in words."""
        reasons = self._session.rows(LAST_OUTCOME if self._seen else LAST_REASON, (last.step,))
        said = f"; the last: {reasons[0][0]}" if reasons else ""
        return f"{'could not be measured' if self._seen else 'had no valid reading'}{said}"


class Far:
    """Poses in a row that were accepted though they are far from where they were predicted.

    An arm that is worse than expected does that, and so does one that was moved: a check tells them apart.
    """

    def __init__(self) -> None:
        self._count, self._is_known = 0, False

    def accepted(self, *, far: bool) -> None:
        """A pose was accepted, far from its prediction or near it."""
        self._count = self._count + 1 if far else 0
        self._is_known = self._is_known and far

    def asks_for_check(self) -> bool:
        """Whether the first contact is to be checked now; once until a pose is near its prediction again."""
        if self._is_known or self._count < FAR_IN_A_ROW:
            return False
        self._is_known = True
        return True


class Frozen:
    """Points that an instrument says again after the arm has gone on, as one does that stopped to follow."""

    def __init__(self) -> None:
        self._steps: dict[tuple[float, ...], int] = {}

    def judged(self, step: Step, reading: Reading, predicted: Floats, likely_m: float) -> Reading:
        """The reading; not valid where it is far from the prediction (3,) and, to the last digit, old."""
        if not reading.valid or reading.point_in_world is None:
            return reading
        point = tuple(reading.point_in_world.tolist())
        first = self._steps.setdefault(point, step.step)
        if first == step.step or math.dist(point, predicted.tolist()) <= likely_m:
            return reading
        return replace(reading, valid=False, reason=REPEATED)
