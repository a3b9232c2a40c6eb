"""Covariance of what a calibration predicts: the arm's part, and together with set-up and noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, Protocol, TypeGuard

import numpy as np

from truearm._core import CoreError, Posterior
from truearm.certainty.successive import Successive
from truearm.certainty.threes import in_threes
from truearm.errors import InputError, UsageError, WorkError
from truearm.fits.core_set import core_set
from truearm.fits.endpoints import Endpoint
from truearm.fits.enough_values import frame_unknowns, setup_unknowns
from truearm.fits.fitting import (
    KnownHyper,
    Task,
    feature_values,
    field_options,
)
from truearm.fits.identified import FRAME_UNKNOWNS
from truearm.fits.measured_parts import MeasuredParts
from truearm.fits.models import CONSTANT
from truearm.fits.parameters import are_lengths
from truearm.revision import Carried
from truearm.types import AXES, Floats, Mask

if TYPE_CHECKING:
    from truearm.calibration import Calibration


BATCH: Final = 512
"""Configurations that an updated calibration is asked for together with the rows of its update."""
FINEST: Final = 1e-8
"""No device tells points or turns of an arm more finely, m and rad."""
MOTIONS: Final = FRAME_UNKNOWNS + AXES
"""Of the base, and of the tool's place."""


class Spread(Protocol):
    """Knows how uncertain the arm's parameters are."""

    def covariance(
        self,
        inputs: Floats,
        jacobian: Floats,
        moved: Floats | None = None,
        place: "SetupPlace | None" = None,
    ) -> Floats:
        """Covariance (n, m, m) of `jacobian` (n, m, 5 L) times parameters at inputs (n, I).

        With `moved` (n, m, 9 or 12), derivatives by motions of base and tool as in SetupPlace, it is that of
        what the device of a set-up sees: what frame and target can take over counts no more. It is the
        set-up of `place`, by default the surest.
        """

    def each(self, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """Covariance (n, m, m) of the same, each of its own, with set-ups as in `joint`."""

    def prior(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Variances (n, m) of the same before any measurement."""

    def joint(self, inputs: Floats, jacobian: Floats, setup: Floats | None = None) -> Floats:
        """Covariance (n m, n m) of the same of all inputs with one another.

        With `setup` (n, m, S), derivatives by the unknowns of all set-ups that were fitted, their part is
        added. m is a multiple of three.
        """

    def cross(self, first: int, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """The block (k m, (n - k) m) of `joint` of the `first` k inputs with the others."""

    def noise(self, jacobian: Floats, orientation: Mask) -> Floats:
        """Covariance (n, m, m) of what a measurement shows anew; `orientation` (m,) tells rows in rad."""


@dataclass(frozen=True, eq=False)
class SetupPlace:
    """What of the unknowns of all set-ups is the frame and the target of one.

    Attributes:
        motion: Motion (12, S) of the base (translation, rotation vector), of the tool (translation in the
            flange's frame, that of the middle of the targets, each as much as its rows are sure) and of the
            measured orientation (rotation vector in the target's frame) with them; zero where nothing was
            fitted. It is that of the set-up with the surest rows, added up.
        turning: The same of the set-up with most orientations, for how a target is turned.
    """

    motion: Floats
    turning: Floats

    @classmethod
    def of(cls, task: Task, measured: MeasuredParts) -> "SetupPlace":
        """Of the set-ups with the surest rows and with most orientations, whatever the order of the rows."""
        surest, turned = measured.surest(task.groups), measured.most_turned(task.groups)
        return cls(_motion(task, measured, surest), _motion(task, measured, turned))

    @classmethod
    def at(cls, calibration: "Calibration", end: Endpoint) -> "SetupPlace | None":
        """Of the set-up in whose world the end is, as its target if it is one; None in the base frame."""
        if end.group is None:
            return None
        motion = _motion(task_of(calibration), calibration.measured, end.group, end.target)
        return cls(motion, motion)

    def among_all(self, moved: Floats | None) -> Floats | None:
        """Derivatives (n, m, S) by all of them, of those (n, m, k) by the first k motions."""
        if moved is None:
            return None
        found = moved @ self.motion[: moved.shape[2]]
        if moved.shape[2] > MOTIONS:
            found[:, AXES:] = moved[:, AXES:] @ self.turning
        return np.ascontiguousarray(found)


def _motion(task: Task, measured: MeasuredParts, group: int, only: int | None = None) -> Floats:
    """Motion (12, S) of base, tool and measured orientation with the unknowns of one set-up.

    The tool moves as the middle of its targets, or as `only` one of them.
    """
    frame, count = frame_unknowns(task), setup_unknowns(task)
    width = count // len(task.groups)
    start, end = group * width, (group + 1) * width
    motion = np.zeros((MOTIONS + AXES, count))
    motion[:frame, start : start + frame] = np.eye(frame)
    shares = measured.shares(group) if only is None else np.eye(len(measured.shares(group)))[only]
    for k, share in enumerate(shares[: len(task.selection.targets)]):
        target = start + frame + AXES * k
        motion[FRAME_UNKNOWNS:MOTIONS, target : target + AXES] = share * np.eye(AXES)
    if measured.orientations[group]:
        motion[MOTIONS:, end - AXES : end] = np.eye(AXES)
    return motion


@dataclass(frozen=True, eq=False)
class ConstantSpread:
    """Constants: one covariance for the whole arm, and behind it of the set-ups.

    What constants leave of the measurements, beside the rows' own sigma, is the arm's as far as anybody can
    tell: it counts wherever the device's frame and target are taken over.
    """

    columns: list[int]
    of_all: Floats
    before: Floats
    noises: tuple[float, float]
    common: float
    place: SetupPlace

    @classmethod
    def of(cls, calibration: "Calibration") -> "ConstantSpread":
        """That of a calibration's constant model."""
        columns = task_of(calibration).columns(calibration.constant.names)
        length, angle, scaled = calibration.options.prior
        scale = calibration.constant.prior_scale if scaled else 1.0
        before = scale * np.where(are_lengths(columns), length, angle)
        details = calibration.constant
        place = SetupPlace.of(task_of(calibration), calibration.measured)
        noises = details.noise_m, details.noise_rad
        common = 0.0 if details.scale is None else details.scale.common
        return cls(columns, details.covariance, before**2, noises, common, place)

    @property
    def with_setup(self) -> Floats:
        """Covariance (P + 9, P + 9) of the constants, and of the motions of base and tool behind them.

        What the constants leave of positions is an uncertain place of the base, the same in all directions.
        """
        count = len(self.columns)
        known = np.zeros((count + MOTIONS, len(self.of_all)))
        known[:count, :count] = np.eye(count)
        known[count:, count : count + self.place.motion.shape[1]] = self.place.motion[:MOTIONS]
        found = known @ self.of_all @ known.T
        found[count : count + AXES, count : count + AXES] += self.noises[0] ** 2 * np.eye(AXES)
        return np.asarray(found)

    def covariance(
        self,
        inputs: Floats,
        jacobian: Floats,
        moved: Floats | None = None,
        place: SetupPlace | None = None,
    ) -> Floats:
        """Covariance (n, m, m), the same rule everywhere; with `moved` what the constants leave is added."""
        found = self.each(inputs, jacobian, (place or self.place).among_all(moved))
        if moved is None:
            return found
        return found + np.diag(np.repeat(np.square(self.noises), AXES)[: jacobian.shape[1]])

    def each(self, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """Covariance (n, m, m), from that of constants and set-up."""
        rows = self.unknown_to(jacobian, setup)
        size = rows.shape[2]
        return np.asarray(rows @ self.of_all[:size, :size] @ rows.transpose(0, 2, 1))

    def unknown_to(self, jacobian: Floats, setup: Floats | None) -> Floats:
        """Derivatives (n, m, u) by the first u of all unknowns: without set-up those of the arm."""
        rows = jacobian[:, :, self.columns]
        return rows if setup is None else np.concatenate([rows, setup], axis=2)

    def prior(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Variances (n, m) that the prior of the constants gives."""
        return np.asarray(np.square(jacobian[:, :, self.columns]) @ self.before)

    def joint(self, inputs: Floats, jacobian: Floats, setup: Floats | None = None) -> Floats:
        """Covariance (n m, n m), from that of constants and set-up."""
        rows = self.unknown_to(jacobian, setup)
        size = rows.shape[2]
        rows = rows.reshape(-1, size)
        return np.asarray(rows @ self.of_all[:size, :size] @ rows.T)

    def cross(self, first: int, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """The block (k m, (n - k) m) of `joint`."""
        rows = self.unknown_to(jacobian, setup)
        size = rows.shape[2]
        left, right = (part.reshape(-1, size) for part in (rows[:first], rows[first:]))
        return np.asarray(left @ self.of_all[:size, :size] @ right.T)

    @property
    def _shared(self) -> float:
        """Covariance of two targets of one pose along the same axis, m^2: each has a part of its own."""
        whole = self.noises[0] ** 2
        return min(self.common * whole, max(whole - FINEST**2, 0.0))

    def noise(self, jacobian: Floats, orientation: Mask) -> Floats:
        """What no constant explains, alike everywhere; targets of one pose have part of it in common."""
        noise = np.diag(np.where(orientation, self.noises[1], self.noises[0]) ** 2)
        targets = int((~orientation).sum()) // AXES
        together = np.kron(np.ones((targets, targets)) - np.eye(targets), np.eye(AXES))
        noise[: len(together), : len(together)] += self._shared * together
        return np.repeat(noise[None], len(jacobian), axis=0)


@dataclass(frozen=True, eq=False)
class VariableSpread:
    """Constants and field: the exact posterior given the rows that were fitted."""

    columns: list[int]
    posterior: Posterior
    inflation: float
    noises: tuple[float, float]
    place: SetupPlace

    def __reduce__(self) -> tuple[object, ...]:
        raise UsageError(
            "what a calibration leaves uncertain is not pickled alone",
            rule="It is worked out from the rows, which the calibration has",
            way_out="Send the calibration, and take calibration.spread from that",
        )

    @classmethod
    def of(cls, calibration: "Calibration") -> "VariableSpread":
        """That of a calibration's variable model, from its rows.

        Raises:
            WorkError: If the rows were left out of the file.
            InputError: If its hyper-parameters are of no arm.
        """
        rows, details = calibration.rows, calibration.variable
        if rows is None or details is None:
            raise WorkError(
                "standard deviations need the measurements that the calibration was fitted to",
                rule="They were left out of this file",
                way_out="Use the file that still has them",
            )
        task = task_of(calibration)
        data = rows.fitted
        measured = core_set(calibration.robot, data, calibration.selection, calibration.groups, rows.weight)
        values = feature_values(data, calibration.options.features)
        names = calibration.identifiability.determined
        options = field_options(task, names, values, details.feature_ranges, KnownHyper(details.hyper))
        columns = list(calibration.arm.candidates.columns)
        point = calibration.models[CONSTANT]
        try:
            posterior = Posterior(task.problem(measured, columns), point.constants, point.setup, options)
        except CoreError as error:
            raise InputError(str(error), where="the calibration's variable model") from None
        place = SetupPlace.of(task, calibration.measured)
        return cls(columns, posterior, details.inflation, noises_of(details.hyper), place)

    def covariance(
        self,
        inputs: Floats,
        jacobian: Floats,
        moved: Floats | None = None,
        place: SetupPlace | None = None,
    ) -> Floats:
        """Covariance (n, m, m) at inputs (n, I)."""
        return self.each(inputs, jacobian, (place or self.place).among_all(moved))

    def each(self, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """Covariance (n, m, m) at inputs (n, I), exact."""
        chosen = np.ascontiguousarray(jacobian[:, :, self.columns])
        return self.posterior.covariance(np.ascontiguousarray(inputs), chosen, setup) * self.inflation**2

    def prior(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Variances (n, m) that constants and field have before any measurement."""
        chosen = np.ascontiguousarray(jacobian[:, :, self.columns])
        return self.posterior.prior(np.ascontiguousarray(inputs), chosen) * self.inflation**2

    def joint(self, inputs: Floats, jacobian: Floats, setup: Floats | None = None) -> Floats:
        """Covariance (n m, n m), exact."""
        found = self.posterior.joint_covariance(*in_threes(inputs, jacobian[:, :, self.columns], setup))
        return np.asarray(found * self.inflation**2)

    def cross(self, first: int, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """The block (k m, (n - k) m) of `joint`."""
        asked = in_threes(inputs, jacobian[:, :, self.columns], setup)
        parts = jacobian.shape[1] // AXES
        return np.asarray(self.posterior.cross_covariance(first * parts, *asked) * self.inflation**2)

    def noise(self, jacobian: Floats, orientation: Mask) -> Floats:
        """Noise of the instrument, and what joints miss anew."""
        chosen = np.ascontiguousarray(jacobian[:, :, self.columns])
        instrument = np.diag(np.where(orientation, self.noises[1], self.noises[0]) ** 2)
        return np.asarray(self.posterior.repeatability(chosen) + instrument) * self.inflation**2


@dataclass(frozen=True, eq=False)
class UpdatedSpread:
    """A calibration whose offsets were estimated again: what was uncertain before, and what they are now.

    The offsets take up what of the errors before looked like them, so that an update of an update is no less
    certain than one.

    Attributes:
        before: Of the calibration that was updated.
        offsets: Derivatives (5 L, u) of the arm's parameters by what was estimated of the arm.
        of_all: Covariance (u + S, u + S) of that and of all set-ups' unknowns, after the update.
        carried: What became of the errors before; None in files that do not tell. Then both parts count in
            full, though they have something in common, and the set-up is that of the calibration before.
        place: What of the unknowns of all set-ups is the frame and the target of one.
    """

    before: Spread
    offsets: Floats
    of_all: Floats
    carried: Carried | None
    place: SetupPlace

    @classmethod
    def of(cls, calibration: "Calibration", before: Spread) -> "UpdatedSpread":
        """That of an updated calibration."""
        revision = calibration.revision
        if revision is None:
            raise WorkError("this calibration was not updated", rule="Only an updated one has this spread")
        place = SetupPlace.of(task_of(calibration), calibration.measured)
        return cls(before, revision.directions, revision.covariance, revision.carried, place)

    def covariance(
        self,
        inputs: Floats,
        jacobian: Floats,
        moved: Floats | None = None,
        place: SetupPlace | None = None,
    ) -> Floats:
        """Covariance (n, m, m)."""
        if self.carried is None:
            own = _each(self._own_rows(jacobian, None), self.of_all)
            return self.before.covariance(inputs, jacobian, moved) + own
        return self.each(inputs, jacobian, (place or self.place).among_all(moved))

    def each(self, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """Covariance (n, m, m), each of its own."""
        if self.carried is None:
            return self.before.each(inputs, jacobian, None) + _each(
                self._own_rows(jacobian, setup), self.of_all
            )
        found = np.empty((len(jacobian), *jacobian.shape[1:2] * 2))
        for first in range(0, len(jacobian), BATCH):
            some = slice(first, first + BATCH)
            own = None if setup is None else setup[some]
            found[some] = self._carried_each(inputs[some], jacobian[some], own)
        return found

    def _carried_each(self, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """Covariance (n, m, m) of no more than can be asked for at once."""
        origin, since = self.origin, self.since
        rows, tied = since.unknown_to(jacobian, setup), since.tied_to(jacobian, setup)
        taken = rows @ since.response
        parts = jacobian.shape[1] // AXES
        with_shown = origin.cross(len(inputs) * parts, *since.with_shown(inputs, jacobian, tied))
        both = taken @ with_shown.reshape(taken.shape).transpose(0, 2, 1)
        found = origin.each(inputs, jacobian, tied) - both - both.transpose(0, 2, 1)
        return found + _each(taken, self._shown) + _each(rows, since.own)

    def prior(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Variances (n, m) before any measurement."""
        return self.before.prior(inputs, jacobian)

    def joint(self, inputs: Floats, jacobian: Floats, setup: Floats | None = None) -> Floats:
        """Covariance (n m, n m)."""
        if self.carried is None:
            rows = _flat(self._own_rows(jacobian, setup))
            return self.before.joint(inputs, jacobian) + _between(rows, self.of_all, rows)
        since = self.since
        rows, tied = _flat(since.unknown_to(jacobian, setup)), since.tied_to(jacobian, setup)
        then = self.origin.joint(*since.with_shown(inputs, jacobian, tied))
        taken, count = rows @ since.response, len(rows)
        both = then[:count, count:] @ taken.T
        found = then[:count, :count] - both - both.T + _between(taken, then[count:, count:], taken)
        return np.asarray(found + _between(rows, since.own, rows))

    def cross(self, first: int, inputs: Floats, jacobian: Floats, setup: Floats | None) -> Floats:
        """The block (k m, (n - k) m) of `joint`."""
        if self.carried is None:
            rows = self._own_rows(jacobian, setup)
            own = _between(_flat(rows[:first]), self.of_all, _flat(rows[first:]))
            return self.before.cross(first, inputs, jacobian, None) + own
        since, origin, parts = self.since, self.origin, jacobian.shape[1] // AXES
        rows, tied = since.unknown_to(jacobian, setup), since.tied_to(jacobian, setup)
        left, right = _flat(rows[:first]), _flat(rows[first:])
        mine = origin.cross(first * parts, *since.with_shown(inputs, jacobian, tied))
        others = since.with_shown(inputs[first:], jacobian[first:], tied[first:])
        theirs = origin.cross((len(inputs) - first) * parts, *others)
        between, shown = mine[:, : len(right)], mine[:, len(right) :]
        taken, taken_there = left @ since.response, right @ since.response
        found = between - shown @ taken_there.T - taken @ theirs.T + _between(taken, self._shown, taken_there)
        return np.asarray(found + _between(left, since.own, right))

    def _own_rows(self, jacobian: Floats, setup: Floats | None) -> Floats:
        """Derivatives (n, m, u) by the first u of this update's unknowns: without set-up those of the arm."""
        rows = jacobian @ self.offsets
        return rows if setup is None else np.concatenate([rows, setup], axis=2)

    @cached_property
    def origin(self) -> Spread:
        """What was uncertain before the first of the updates in `since`."""
        before = self.before
        return before.origin if _tells(before) else before

    @cached_property
    def since(self) -> Successive:
        """This update, and those before it that tell what became of the errors before, as one."""
        if self.carried is None:
            raise WorkError("this update carries nothing", rule="Only what it made of errors before is known")
        one, before = Successive.one(self.offsets, self.carried), self.before
        return before.since.then(one) if _tells(before) else one

    @cached_property
    def _shown(self) -> Floats:
        """Covariance (3 R, 3 R) before these updates of what their rows showed."""
        since = self.since
        return self.origin.joint(since.inputs, since.jacobian, since.setup)

    def noise(self, jacobian: Floats, orientation: Mask) -> Floats:
        """As before."""
        return self.before.noise(jacobian, orientation)


def _tells(spread: Spread) -> TypeGuard[UpdatedSpread]:
    """Whether it is of an update that tells what became of the errors before."""
    return isinstance(spread, UpdatedSpread) and spread.carried is not None


def _each(rows: Floats, covariance: Floats) -> Floats:
    """Covariance (n, m, m) of rows (n, m, u) by the first u unknowns of a covariance."""
    size = rows.shape[2]
    return np.asarray(rows @ covariance[:size, :size] @ rows.transpose(0, 2, 1))


def _between(left: Floats, covariance: Floats, right: Floats) -> Floats:
    """Covariance (p, q) of rows (p, u) with others (q, u) by the first u unknowns of a covariance."""
    size = left.shape[1]
    return np.asarray(left @ covariance[:size, :size] @ right.T)


def _flat(rows: Floats) -> Floats:
    """Rows (n m, u) of those (n, m, u)."""
    return rows.reshape(-1, rows.shape[2])


def noises_of(hyper: Mapping[str, Sequence[float]]) -> tuple[float, float]:
    """Noise of positions in m and of orientations in rad among a field's hyper-parameters."""
    return hyper["noise_position"][0], hyper["noise_orientation"][0]


def task_of(calibration: "Calibration") -> Task:
    """The task that made a calibration."""
    return Task(calibration.arm, calibration.selection, calibration.groups, calibration.options)
