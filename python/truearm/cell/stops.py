"""Places to which the arm is not sent again, since stops on the way there ended former processes."""

import json
from collections import Counter
from typing import Final

from truearm.cell.device_errors import DeviceError, EmergencyStopError, ProtectiveStopError
from truearm.cell.session import Session, Step

EMERGENCY, PROTECTIVE = "emergency stop", "protective stop"
MOST_STOPS: Final = {PROTECTIVE: 1, EMERGENCY: 2}
"""Stops on the way to a place after which it is not gone to again."""
STOPS: Final = (
    "SELECT events.kind, steps.readings FROM events JOIN steps USING (step) WHERE events.kind IN (?, ?)"
)
CONTACTS: Final = (
    "SELECT readings FROM steps JOIN outcomes USING (step) "
    "WHERE kind = 'registration' AND outcome = 'measured'"
)

Place = tuple[float, ...]


def kind_of(error: DeviceError) -> str:
    """The kind of event that an error of a device is."""
    if isinstance(error, ProtectiveStopError):
        return PROTECTIVE
    return EMERGENCY if isinstance(error, EmergencyStopError) else "device"


class Stops:
    """What a session knows of stops as a process begins.

    A place is known by its joint readings, whichever step leads there and from whichever side: what the arm
    met on its way is in the way of a repeat and of a contact too.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        counted = Counter((kind, _place(text)) for kind, text in session.rows(STOPS, tuple(MOST_STOPS)))
        self._told: dict[Place, str] = {}
        for kind, most in MOST_STOPS.items():
            places = [place for (stop, place), count in counted.items() if stop == kind and count >= most]
            self._told |= dict.fromkeys(places, f"{kind} on the way here before")

    def at(self, step: Step) -> str:
        """Why a step is not tried again; empty where it is to be done.

        A check is tried again where no other contact is left for it: nothing else says whether arm and
        instrument stand still.
        """
        why = self._told.get(tuple(step.readings.tolist()), "")
        return "" if why and step.kind == "check" and not self._has_free_contact() else why

    def skipped(self) -> int:
        """How many contacts and poses that are left will be skipped."""
        if not self._told:
            return 0
        return sum(step.kind != "check" and bool(self.at(step)) for step in self._session.all_left())

    def _has_free_contact(self) -> bool:
        return any(_place(text) not in self._told for (text,) in self._session.rows(CONTACTS))


def _place(readings: str) -> Place:
    return tuple(map(float, json.loads(readings)))
