"""Driver of the Mitsubishi RV-M2 (and RV-M1): Movemaster commands over RS-232.

The controller moves joints by increments and tells where it is as a Cartesian position only. So the driver
goes to the mechanical origin when it connects and counts from there, in tenths of a degree as the controller
does. It carries the nominal kinematics of the arm: after every increment it asks the controller where it is
and compares with what the nominal arm would be at the count. A command that was lost, damaged or done twice
shows there and is put right. Joint readings are therefore exact, as long as the nominal kinematics are those
the controller computes with.

The command set has no way to end a motion. Increments are kept so short that they take `leg_s` seconds at the
most, and a stop takes hold after the one under way.
"""

import math
import threading
import time
from typing import Final

import numpy as np
from pydantic import Field

from truearm.cell import movemaster
from truearm.cell.device_errors import (
    DeviceError,
    DeviceSilentError,
    EmergencyStopError,
    RefusedError,
)
from truearm.cell.line_port import LinePort, PortSection
from truearm.cell.movemaster import TENTH, Tenths, readings_of, tenths
from truearm.cell.protocols import Managed
from truearm.cell.schema import Frame, Positive
from truearm.inverse import Inverse
from truearm.robot import Robot
from truearm.rotations import rigid_inverse
from truearm.types import Floats
from truearm.units import RADIANS_PER_DEGREE

# The read-out may be off by its rounding, half a unit, and by the rounding of what is added up in it.
READOUT_TOLERANCE: Final = 0.11
TRIES: Final = 8
MOTION_MARGIN: Final = 1.5
FRESH_S: Final = 0.05


class RvM2(Managed):
    """A Movemaster robot; see the module."""

    class Settings(PortSection):
        """Keys of [robot] with driver "rv-m2"."""

        driver: str = "rv-m2"
        frame: Frame = "7E2"
        timeout_s: Positive = 3.0
        speed: int = Field(default=5, ge=0, le=9)
        leg_s: Positive = 0.5
        origin_deg: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
        origin_timeout_s: Positive = 60.0

    def __init__(self, settings: Settings, arm: Robot) -> None:
        movemaster.check_arm(arm)
        self._settings, self._arm = settings, arm
        self._port = LinePort.of(self.name, settings, terminator=movemaster.TERMINATOR)
        self._count: Tenths | None = None
        self._guesses: list[Tenths] = []
        self._low, self._high = np.rint(arm.limits.T / TENTH).tolist()
        self._leg = max(1, round(10.0 * settings.leg_s * movemaster.SPEEDS_DEG_S[settings.speed]))
        self._busy = threading.RLock()
        self._still_at = 0.0
        self._seen_at = -math.inf
        self._silences = 0

    @property
    def name(self) -> str:
        """See Device."""
        return "RV-M2"

    @property
    def address(self) -> str:
        """See Device."""
        return self._settings.port

    def connect(self) -> None:
        """Open the port, clear a command error, and go to the mechanical origin."""
        with self._busy, self._port.opened():
            self._silences = 0
            self._go_to_origin()

    def move_joints(self, readings: Floats) -> None:
        """See Robot. The arm ends at whole tenths of a degree."""
        wanted = np.asarray(readings)
        if not all(map(math.isfinite, wanted.tolist())):
            raise RefusedError("readings that are no numbers", where=self._port.where)
        target = tenths(wanted)
        self._check_limits(target)
        with self._busy:
            legs = math.ceil(_longest(_apart(target, self._known_count())) / self._leg)
            for _ in range(legs + TRIES):
                if self._known_count() == target:
                    return
                self._move_leg(target)
            raise DeviceError(
                f"the arm did not get to its place in {legs + TRIES} motions", where=self._port.where
            )

    def move_pose(self, base_from_tool: Floats) -> None:
        """See Robot. The readings come from the nominal kinematics, nearest to the present ones."""
        base_from_flange = base_from_tool @ rigid_inverse(self._arm.tool)
        self.move_joints(Inverse(self._arm).near(base_from_flange, self.read_joints()))

    def read_joints(self) -> Floats:
        """See Robot. Counted from the origin and checked against the controller's Cartesian read-out.

        A motion ends with such a check, which is good for FRESH_S.
        """
        with self._busy:
            count = self._known_count()
            if time.monotonic() - self._seen_at > FRESH_S:
                self._locate([count], self._port.limit_s)
            return readings_of(self._known_count())

    def stop(self) -> None:
        """See Device. No further increment is sent; the one under way ends by itself, and is waited for.

        The way to the origin, on connecting, ends by itself too, and is not waited for: no command ends it.
        """
        self._port.end_waits(self._busy)
        time.sleep(max(0.0, self._still_at - time.monotonic()))

    def close(self) -> None:
        """See Device."""
        self._port.close()
        self._count, self._guesses = None, []

    def _go_to_origin(self) -> None:
        self._check_error()
        origin = tenths(np.array(self._settings.origin_deg) * RADIANS_PER_DEGREE)
        for _ in range(TRIES):
            self._port.begin("NT", f"SP {self._settings.speed}")
            if self._locate([origin], self._settings.origin_timeout_s, strict=False):
                return
        raise DeviceError(
            "the origin is not where the nominal arm has it",
            where=self._port.where,
            rule="After NT the read-out must be that of origin_deg under the nominal kinematics",
            way_out="Correct origin_deg, or the arm of the cell file",
        )

    def _known_count(self) -> Tenths:
        """Where the arm is, found out anew where a stop or a failure left that open."""
        if self._count is None and self._guesses:
            self._locate(self._guesses, self._port.limit_s)
        if self._count is None:
            raise DeviceError("where the arm is, is not known", where=self._port.where, way_out="Connect it")
        return self._count

    def _check_limits(self, target: Tenths) -> None:
        for joint, (low, count, high) in enumerate(zip(self._low, target, self._high, strict=True)):
            if not low <= count <= high:
                raise RefusedError(
                    f"joint {joint + 1} at {count / 10:.1f} deg",
                    where=self._port.where,
                    rule=f"Its limits are {low / 10:g} to {high / 10:g} deg",
                )

    def _move_leg(self, target: Tenths) -> None:
        """One increment straight towards the target, and a look at where that led."""
        before = self._known_count()
        way = _apart(target, before)
        share = min(1.0, self._leg / _longest(way))
        step = tuple([round(share * each) for each in way])
        there = _beyond(before, step)
        beyond = _beyond(there, step)
        self._count, self._guesses = None, [there, before, beyond]
        self._seen_at = -math.inf
        seconds = MOTION_MARGIN * self._seconds(step)
        self._still_at = time.monotonic() + seconds
        moving = f"MJ {movemaster.listed(step)}"
        self._locate(self._guesses, self._port.limit_s + seconds, moving)
        if self._known_count() == before:
            # Lost, or only late: sent again too early it would be done twice.
            self._port.pause(self._port.limit_s)
            self._locate([before, there], self._port.limit_s + seconds)
        self._still_at = 0.0

    def _seconds(self, step: Tenths) -> float:
        return _longest(step) / 10.0 / movemaster.SPEEDS_DEG_S[self._settings.speed]

    def _locate(self, guesses: list[Tenths], limit_s: float, *first: str, strict: bool = True) -> bool:
        """Ask where the arm is until the answer fits, and take the count that it fits.

        Commands that come `first` are sent once, with the first question.
        An answer that fits the first guess is believed at once. Any other must come twice in a row, as it may
        be damaged or late; then the other guesses count, and then the nominal inverse kinematics.
        """
        last: Tenths | None = None
        for attempt in range(TRIES):
            seen = self._where(limit_s, *(() if attempt else first))
            if seen is not None and self._fits(seen, guesses[0]):
                self._count = guesses[0]
                return True
            if seen is not None and seen == last:
                found = self._recognised(seen, guesses) if strict else None
                if found is not None:
                    self._count = found
                    return True
                if attempt > TRIES // 2:
                    break
            last = seen
            self._check_error()
        if not strict:
            return False
        raise DeviceError(
            "its read-out belongs to no place that the arm can be at, or changes from one to the next",
            where=self._port.where,
            rule="The nominal arm must give the same position as the controller, to 0.1 mm and 0.1 deg",
        )

    def _where(self, limit_s: float, *first: str) -> Tenths | None:
        """What WH answers, in tenths, after what is sent first; None if nothing readable came."""
        self._port.drain()
        send = self._port.begin if first else self._port.send
        send(*first, "WH")
        try:
            return movemaster.parse_numbers(self._port.receive(limit_s, doing="say where it is"))
        except DeviceSilentError:
            self._silences += 1
            if self._silences >= TRIES // 2:
                raise
            return None

    def _recognised(self, seen: Tenths, guesses: list[Tenths]) -> Tenths | None:
        for guess in guesses:
            if self._fits(seen, guess):
                return guess
        for seed in guesses:
            found = movemaster.readings_near(self._arm, [0.1 * each for each in seen], readings_of(seed))
            if found is not None and self._fits(seen, tenths(found)):
                return tenths(found)
        return None

    def _fits(self, seen: Tenths, count: Tenths) -> bool:
        nominal = movemaster.whereabouts(self._arm, readings_of(count))
        fits = max([abs(a - 0.1 * b) for a, b in zip(nominal, seen, strict=True)]) <= READOUT_TOLERANCE
        if fits:
            self._silences, self._seen_at = 0, time.monotonic()
        return fits

    def _check_error(self) -> None:
        """Ask for the error; reset one of a command, raise one of the hardware."""
        self._port.drain()
        self._port.send("ER")
        try:
            answer = self._port.receive(doing="say its error").strip()
        except DeviceSilentError:
            self._silences += 1
            if self._silences >= TRIES // 2:
                raise
            return
        if answer == movemaster.HARDWARE_ERROR:
            self._confirm_hardware_error()
        elif answer != movemaster.NO_ERROR:
            self._port.send("RS")

    def _confirm_hardware_error(self) -> None:
        """Raise if a second answer says so too: one alone may be damaged."""
        self._port.drain()
        self._port.send("ER")
        if self._port.receive(doing="say its error").strip() == movemaster.HARDWARE_ERROR:
            raise EmergencyStopError(
                "the controller reports a hardware error or an emergency stop",
                where=self._port.where,
                way_out="Release the button, reset the controller, and start again: the session continues",
            )


def _apart(target: Tenths, start: Tenths) -> Tenths:
    return tuple([to - at for to, at in zip(target, start, strict=True)])


def _beyond(start: Tenths, step: Tenths) -> Tenths:
    return tuple([at + by for at, by in zip(start, step, strict=True)])


def _longest(way: Tenths) -> int:
    return max(map(abs, way))
