"""The measurement process: every step of a session, one after another, whatever goes wrong."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from truearm.cell.accepted import points_and_joints
from truearm.cell.alone import alone
from truearm.cell.at_rest import AtRest
from truearm.cell.cell_file import Cell
from truearm.cell.checks import CONTRADICTED, has_contradicted, raise_if_moved, raise_unsure, tells_nothing
from truearm.cell.contacts import contacts_left, take_contacts_back
from truearm.cell.crew import Crew, places_on_the_way
from truearm.cell.device_errors import (
    Calls,
    DeviceError,
    DeviceSilentError,
    PortUnavailableError,
    RefusedError,
    StoppedError,
)
from truearm.cell.in_a_row import Far, Frozen, Unmeasured
from truearm.cell.judge import Rules, Verdict, judge
from truearm.cell.prediction import Prediction
from truearm.cell.reading import Expected, Reading, checked_reading
from truearm.cell.registering import register_cell
from truearm.cell.scatter import told_coarse
from truearm.cell.session import Session, Step, Stored
from truearm.cell.stops import Stops, kind_of
from truearm.cell.stretches import boundaries, calibrate_so_far, good_enough
from truearm.errors import count_of
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si

# Between the last look whether to go on and the moment at which a device can be stopped.
BEGINS_WITHIN_S: Final = 0.05
LONGEST_RECOVERY_S: Final = 60.0
# Steps in a row that are given up because devices fail there each time; then it is not the steps.
GIVEN_UP_IN_A_ROW: Final = 3
DONE: Final = "all poses are done"
ACCURATE: Final = "the target accuracy is met"
DONE_STEPS: Final = "SELECT coalesce(max(step), -1) + 1 FROM outcomes"
OTHERS_BETWEEN: Final = "SELECT 1 FROM steps WHERE step >= ? AND step < ? AND kind != 'check' LIMIT 1"
NO_BETTER: Final = "readings are still judged by the registered frame, which predicts them no worse"
UNCHECKED: Final = "no contact could be measured again: whether anything has moved is not known"


@dataclass(frozen=True)
class Progress:
    """How far the process is.

    Attributes:
        done: Steps that have an outcome.
        total: Steps in all.
        text: What was done last.
        left_s: Time left at the present pace; None before there is one.
    """

    done: int
    total: int
    text: str
    left_s: float | None


class Process:
    """Measures the steps of a session that have no outcome yet.

    `run` does the work in the thread that calls it; `halt` ends it from another one: both devices are stopped
    at once, the sensor is retracted, the ports are closed, and `run` raises StoppedError.
    """

    def __init__(self, cell: Cell, session: Session, report: Callable[[Progress], None]) -> None:
        self._cell, self._session, self._report = cell, session, report
        self._process = cell.file.process
        self._agree_m = to_si(self._process.agree_mm, "mm")
        self._prediction = Prediction(cell)
        self._halted, self._ended = threading.Event(), threading.Event()
        self._crew = Crew(cell, session.add_event, self._halted)
        self._unmeasured, self._far, self._frozen = Unmeasured(session), Far(), Frozen()
        self._stops = Stops(session)
        self._recoveries = self._given_up = 0
        self._is_coarse = False
        self._total = session.rows("SELECT count(*) FROM steps")[0][0]
        self._poses = session.rows("SELECT count(*) FROM steps WHERE kind = 'pose'")[0][0]
        self._boundaries = boundaries(self._process.stretch, self._poses)
        self._measured = session.measured_poses()
        self._count_done()
        self._began = time.monotonic()

    def _count_done(self) -> None:
        """Know what is done already."""
        self._done = self._done_before = int(self._session.rows(DONE_STEPS)[0][0])
        # Readings may be left of the last step that a former process had begun; before it may be a check.
        self._begun = self._done_before + 1

    def run(self) -> str:
        """Measure until all is done, or well enough; says which.

        Raises:
            StoppedError: If `halt` was called.
            WorkError: If the frame is implausible, the cell drifts, the target is lost, a device fails for
                good, or another process drives the arm.
        """
        self._resume()
        end = self._end()
        if end is not None:
            raise_if_moved(self._session, self._process.drift_mm)
            return end
        with alone(self._cell):
            return self._driven()

    def _driven(self) -> str:
        """Connect the devices and measure; they are stopped and let go of whatever happens."""
        self._go_on()
        skipped = self._stops.skipped()
        if skipped:
            self._say(f"{count_of(skipped, 'step')} to places that stops kept the arm from will be skipped")
        try:
            self._connect()
            return self._steps()
        except BaseException as error:
            self._crew.stop()
            if not isinstance(error, Exception) or isinstance(error, StoppedError):
                self._session.add_event("interrupted", "the process was ended")
            else:
                self._session.add_event("stopped", str(error))
            raise
        finally:
            self._ended.set()
            self._crew.dismiss()

    def halt(self) -> None:
        """End `run` from another thread.

        What was just about to begin as the first stop came is ended by a second.
        """
        self._halted.set()
        self._crew.stop()
        if not self._ended.wait(BEGINS_WITHIN_S):
            self._crew.stop()

    def _end(self) -> str | None:
        """How the session has ended; None while there is something to measure."""
        if good_enough(self._session, self._process.target_mm):
            return ACCURATE
        return DONE if self._session.next_step() is None else None

    def _steps(self) -> str:
        while True:
            for step in self._session.steps_left():
                if step.kind == "pose" and not self._prediction.is_registered:
                    self._register()
                measured = self._do(step)
                # Steps behind a new check count on from it.
                if step.kind == "check" and self._checks_elsewhere(step):
                    break
                is_accurate = step.kind == "pose" and measured and self._after_pose()
                if self._far.asks_for_check() and self._session.check_next():
                    self._total += 1
                    break
                if is_accurate:
                    return ACCURATE
            else:
                return DONE

    def _do(self, step: Step) -> bool:
        """Measure a step until its readings can be believed, or it is given up; whether it is measured."""
        stops = self._stops.at(step)
        if stops:
            self._skip(step, stops)
            return False
        expected = self._prediction.expected(step)
        point, likely_m = self._prediction.point(expected), self._prediction.likely_m
        rules = Rules(self._process.contacts, self._process.attempts, self._agree_m, likely_m)
        readings, placed = self._known_of(step), False
        rest = AtRest(self._cell, self._agree_m, step.readings)
        verdict = judge(readings, point, rules)
        self._decide(step, verdict)
        while verdict.decision == "again":
            try:
                if not placed:
                    rest.arrived(self._placed(step, expected, anew=verdict.suspicious))
                told, joints = self._told(), self._crew.where()
            except RefusedError as error:
                return self._refused(step, error)
            except DeviceError as error:
                if not self._try_again(error, step):
                    return False
                placed = False
                continue
            reading = rest.judged(self._frozen.judged(step, told, point, likely_m), joints)
            self._works(reading)
            readings.append(_stored(len(readings) + 1, reading))
            verdict = judge(readings, point, rules)
            self._keep(step, reading, rest.joints, point, verdict, len(readings))
            # An arm that comes to rest is given time: sent there anew it would lag as much again.
            placed = (reading.valid or rest.settles) and not verdict.suspicious
        self._tell(step, verdict)
        return self._counted(step, verdict, readings)

    def _told(self) -> Reading:
        """What the sensor says of the target now."""
        self._crew.raise_if_halted()
        with Calls(self._cell.sensor):
            return checked_reading(self._cell.sensor.measure())

    def _works(self, reading: Reading) -> None:
        """Devices work where there is a reading; a valid one tells how well the instrument measures."""
        self._recoveries = self._given_up = 0
        if self._is_coarse or not reading.valid:
            return
        words = told_coarse(reading.sigma_m, self._process)
        if words:
            self._is_coarse = True
            self._session.add_event("coarse", words)
            self._say(words)

    def _counted(self, step: Step, verdict: Verdict, readings: list[Stored]) -> bool:
        """Count a step that is done with among those before it; whether it is measured.

        Raises:
            WorkError: If too many in a row were given up.
        """
        measured = verdict.decision == "accept"
        if measured:
            self._unmeasured.measured()
        else:
            self._unmeasured.given_up(step, seen=any(reading.valid for reading in readings))
        if step.kind == "pose" and measured:
            self._far.accepted(far=verdict.suspicious)
        return measured

    def _known_of(self, step: Step) -> list[Stored]:
        """Readings that a former process left."""
        return self._session.readings_of(step.step) if self._was_begun(step) else []

    def _was_begun(self, step: Step) -> bool:
        """Whether a former process may have begun a step."""
        return step.step <= self._begun

    def _keep(
        self, step: Step, reading: Reading, joints: Floats, expected: Floats, verdict: Verdict, attempt: int
    ) -> None:
        """A reading, and the outcome if that is it, on disk together."""
        if verdict.decision == "again":
            self._session.add_reading(step.step, attempt, reading, joints, expected)
            return
        with self._session.together():
            self._session.add_reading(step.step, attempt, reading, joints, expected)
            self._decide(step, verdict)

    def _decide(self, step: Step, verdict: Verdict) -> None:
        if verdict.decision == "accept":
            self._session.add_outcome(step.step, "measured", attempts=verdict.attempts)
        if verdict.decision == "give up":
            self._session.add_outcome(step.step, "skipped", reason=verdict.reason)

    def _skip(self, step: Step, reason: str) -> None:
        self._done = step.step + 1
        self._session.add_outcome(step.step, "skipped", reason=reason)
        self._session.add_event("skipped", reason, step.step)
        self._say(f"{step.kind} {step.pose + 1} skipped: {reason}")

    def _refused(self, step: Step, error: RefusedError) -> bool:
        """Skip a step that a device refuses; what answers a stop may look like a refusal, and is none."""
        self._crew.raise_if_halted()
        self._skip(step, str(error))
        return False

    def _try_again(self, error: DeviceError, step: Step) -> bool:
        """Connect anew after a failure at a step; whether to try it again, as otherwise it is skipped.

        Raises:
            DeviceError: If connecting does not help either, or steps before were given up as well.
        """
        if self._recoveries < self._process.recoveries:
            self._recover(error, step)
            return True
        tries, self._recoveries = self._recoveries + 1, 0
        self._given_up += 1
        if self._given_up > GIVEN_UP_IN_A_ROW:
            raise error
        self._recover(error, step)
        self._recoveries = 0
        self._skip(step, f"tried {tries} times: {error}")
        return False

    def _placed(self, step: Step, expected: Expected, *, anew: bool) -> Floats:
        """Bring arm and sensor to a step; where the arm is.

        Coming `anew` is given up where there is no way: the pose is then measured without.
        """
        frame = self._prediction.world_from_base
        try:
            return self._crew.go(self._way(step, anew=anew), expected, frame)
        except RefusedError:
            if step.approach or not anew:
                raise
            return self._crew.go([step.readings], expected, frame)

    def _way(self, step: Step, *, anew: bool) -> list[Floats]:
        """Readings to go through, so that every joint comes from the side that is asked for.

        With `anew` the arm leaves a pose that it may already be at, where any side will do.
        """
        return places_on_the_way(self._cell, step.readings, step.approach or int(anew))

    def _connect(self) -> None:
        """Connect for the first time; a port that cannot be opened then is not tried again."""
        try:
            self._crew.connect()
        except PortUnavailableError:
            raise
        except DeviceError as error:
            self._recover(error, None)
            self._recoveries = 0

    def _recover(self, error: DeviceError, step: Step | None) -> None:
        """Connect anew, if that may help and did not fail too often.

        Before a port is tried again that could not be opened it waits, twice as long each time: a device that
        starts anew takes a while. One that is silent has had its time limit.
        """
        wait_s = 0.0
        while True:
            self._crew.raise_if_halted()
            self._recoveries += 1
            self._session.add_event(kind_of(error), str(error), None if step is None else step.step)
            if not error.recoverable or self._recoveries > self._process.recoveries:
                raise error
            if wait_s and not isinstance(error, DeviceSilentError):
                self._wait(wait_s, error)
            try:
                self._crew.recover()
            except DeviceError as again:
                error, wait_s = again, min(max(self._process.recovery_s, 2.0 * wait_s), LONGEST_RECOVERY_S)
            else:
                return

    def _wait(self, seconds: float, error: DeviceError) -> None:
        """Wait for a device that cannot be connected, unless the process is to end."""
        left = self._process.recoveries - self._recoveries
        self._say(f"connecting anew in {seconds:g} s, then {count_of(left, 'time')} more: {error}")
        self._halted.wait(seconds)
        self._crew.raise_if_halted()

    def _register(self) -> None:
        _, joints, points = points_and_joints(self._session, "registration")
        found = register_cell(self._cell, joints, points)
        residual_mm = MM_PER_METRE * found.residual_m
        self._session.set_registration(found.world_from_base, residual_mm, found.poses)
        self._prediction.register(found.world_from_base, found.residual_m)
        self._say(f"frame registered from {found.poses} contacts, {residual_mm:.2f} mm RMS")

    def _resume(self) -> None:
        """Know again what a former process knew."""
        known = self._session.registration()
        if known is not None:
            self._prediction.register(known[0], known[1] / MM_PER_METRE)
        past = [count for count in self._boundaries if count <= self._measured]
        if past:
            self._learn(past[-1])

    def _go_on(self) -> None:
        """Begin with a check where a former process has measured: something may have been moved meanwhile.

        What was refused for the frame is refused before anything is measured for nothing.
        """
        if not self._done_before:
            return
        if not self._prediction.is_registered and not contacts_left(self._session):
            if take_contacts_back(self._session):
                self._count_done()
            else:
                self._register()
        self._total += self._session.check_next()

    def _after_pose(self) -> bool:
        """Calibrate at the end of a stretch; whether that is good enough."""
        self._measured += 1
        if self._measured not in self._boundaries:
            return False
        self._learn(self._measured)
        return good_enough(self._session, self._process.target_mm)

    def _learn(self, measured: int) -> None:
        stretch = calibrate_so_far(self._cell, self._session, measured, self._session.add_event)
        if stretch is None:
            return
        self._session.add_stretch(
            measured, stretch.model, stretch.mean_mm, stretch.p95_mm, stretch.expected_mm
        )
        if not self._prediction.learn(stretch.calibration, stretch.p95_mm / MM_PER_METRE):
            self._session.add_event("calibration", f"{measured} poses: {NO_BETTER}")
        self._say(
            f"{measured} poses, {stretch.model} model: {stretch.mean_mm:.3f} mm mean on held-out poses, "
            f"{stretch.expected_mm:.3f} mm expected"
        )

    def _checks_elsewhere(self, step: Step) -> bool:
        """Look at what a check tells; whether another contact is to be checked next, since it tells nothing.

        Raises:
            WorkError: If something has moved; or if no contact can be measured again, as a session goes on,
                or with steps left and readings that contradict one another.
        """
        if not tells_nothing(self._session, step.step):
            raise_if_moved(self._session, self._process.drift_mm)
            return False
        if self._session.check_elsewhere(step.step):
            self._total += 1
            self._begun += 1
            return True
        contradicted = has_contradicted(self._session, step.step) and self._session.next_step() is not None
        if contradicted or not self._session.rows(OTHERS_BETWEEN, (self._done_before, step.step)):
            if contradicted:
                self._unmeasured.take_back(CONTRADICTED)
            raise_unsure(contradicted=contradicted)
        self._session.add_event("unchecked", UNCHECKED, step.step)
        self._say(UNCHECKED)
        return False

    def _tell(self, step: Step, verdict: Verdict) -> None:
        self._done = step.step + 1
        if verdict.decision == "give up":
            self._say(f"{step.kind} {step.pose + 1} skipped: {verdict.reason}")
            return
        off = f"{MM_PER_METRE * verdict.off_m:.3f} mm from the prediction"
        if not math.isfinite(self._prediction.likely_m):
            off = "its place was not known before"
        self._say(f"{step.kind} {step.pose + 1} stored, {off}")

    def _say(self, text: str) -> None:
        new = self._done - self._done_before
        left_s = (self._total - self._done) * (time.monotonic() - self._began) / new if new else None
        self._report(Progress(self._done, self._total, text, left_s))


def _stored(attempt: int, reading: Reading) -> Stored:
    point = None if reading.point_in_world is None else tuple(reading.point_in_world.tolist())
    return Stored(attempt, reading.valid, point, reading.sigma_m)
