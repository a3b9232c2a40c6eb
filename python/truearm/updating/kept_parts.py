"""What set-ups showed before and an update did not measure: targets and turns that stay as they were."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from truearm._core import Setup
from truearm.calibration import Calibration
from truearm.certainty.uncertainty import task_of
from truearm.errors import Notice, list_names
from truearm.fits.core_set import Selection
from truearm.fits.details import left_m
from truearm.fits.enough_values import setup_unknowns
from truearm.fits.measured_parts import MeasuredParts, sureness
from truearm.measurements import Measurements
from truearm.revision import Carried
from truearm.types import AXES, Floats
from truearm.updating.parts import places_of
from truearm.updating.scale import sigmas_m
from truearm.updating.scene import Scene


@dataclass(frozen=True, eq=False)
class KeptParts:
    """The set-ups of an updated calibration: what was measured now, and what was fitted before.

    What was not measured now stays with the tool that it belongs to: where that was found anew or moved, it
    is no longer known.

    Attributes:
        calibration: As it was.
        scene: What was measured now.
        moved: Set-ups whose tool moved.
    """

    calibration: Calibration
    scene: Scene
    moved: Collection[str]

    @cached_property
    def selection(self) -> Selection:
        """What takes part in the updated calibration."""
        now, then = self.scene.task.selection, self.calibration.selection
        targets = tuple(sorted({*now.targets, *then.targets}))
        return replace(now, targets=targets, orientation=now.orientation or then.orientation)

    @cached_property
    def measured(self) -> MeasuredParts:
        """How many rows hold it: those of the update, and those before of what is kept."""
        task, then, now = self.scene.task, self.calibration.measured, self._measured_now
        targets = np.zeros((len(task.groups), len(self.selection.targets)), dtype=np.int64)
        worth = targets.astype(np.float64)
        places = [self.selection.targets.index(target) for target in task.selection.targets]
        targets[:, places], worth[:, places] = now.targets, now.worth
        orientations = now.orientations.copy()
        for k, number in self._kept.items():
            for target in self._old_targets:
                here, there = (of.selection.targets.index(target) for of in (self, self.calibration))
                targets[k, here], worth[k, here] = then.targets[number, there], then.worth[number, there]
            if self._old_turn:
                orientations[k] = then.orientations[number]
        return MeasuredParts(now.rows, targets, orientations, worth)

    @property
    def _measured_now(self) -> MeasuredParts:
        """What the rows of each set-up hold, of which the calibration leaves as much as before."""
        task, own = self.scene.task, sigmas_m(self.calibration, self.scene.data)
        left = left_m(self.calibration.constant, self.calibration.variable)
        sure = sureness(own, left, np.ones(len(own)))
        return MeasuredParts.of(self.scene.data, task.selection, task.groups, sure)

    @property
    def notices(self) -> list[Notice]:
        """What of the tool was not measured, and whether it is still known."""
        if not (self._old_targets or self._old_turn):
            return []
        parts = [f"target {target + 1}" for target in self._old_targets]
        parts += ["the orientation of the target"] if self._old_turn else []
        groups = self.scene.task.groups
        kept = [group for k, group in enumerate(groups) if k in self._kept]
        lost = [group for group in groups if group not in kept]
        said = f"Not measured now: {', '.join(parts)}."
        if kept:
            said += f" In {list_names(kept)} it is taken to be as it was."
        if lost:
            said += (
                f" In {list_names(lost)} it is no longer known, since the tool moved or was found anew: "
                "measure it in an update to know it again."
            )
        return [Notice("not_measured", said)]

    def setup(self, now: Setup, before: Setup) -> Setup:
        """Set-ups of a model with what was measured now, and what it had of the rest before."""
        count, used = len(now.frames), self.scene.task.selection
        targets, rotations = np.zeros((count, len(self.selection.targets), AXES)), now.rotations.copy()
        targets[:, [self.selection.targets.index(target) for target in used.targets]] = now.targets
        for k, number in self._kept.items():
            for target in self._old_targets:
                place = self.calibration.selection.targets.index(target)
                targets[k, self.selection.targets.index(target)] = before.targets[number, place]
            if self._old_turn:
                rotations[k] = before.rotations[number]
        return Setup(now.frames, targets, rotations, now.anchors)

    def covariance(self, now: Floats) -> Floats:
        """Covariance (u + S, u + S) of the arm and these set-ups, from that of what was measured now."""
        among = self._with_arm(len(now))
        return np.asarray(among @ now @ among.T)

    def carried(self, errors: Carried) -> Carried:
        """The same of what became of errors: what is kept is off by what it was off before."""
        among = self._with_arm(len(errors.own))
        tied = self._among @ errors.tied
        old, arm = self.calibration.selection, self.calibration.arm
        frame = arm.frame_unknowns
        width = errors.tied.shape[1] // len(self.calibration.groups)
        for k, number in self._kept.items():
            unmeasured = Selection(self._old_targets, self._old_turn)
            here, there = (places_of(arm, unmeasured, fitted)[frame:] for fitted in (self.selection, old))
            tied[k * self._width + here, number * width + there] = 1.0
        own = np.asarray(among @ errors.own @ among.T)
        return replace(errors, response=among @ errors.response, own=own, tied=tied)

    def rows(self, data: Measurements, residual: Floats) -> tuple[Measurements, Floats]:
        """Rows with columns for all that takes part, and their residuals (n, m), zero where not measured."""
        used, whole, arm = self.scene.task.selection, self.selection, self.calibration.arm
        missing = max(whole.targets) + 1 - data.targets.shape[1]
        empty = np.full((len(data), max(missing, 0), AXES), np.nan)
        found = np.zeros((len(data), AXES * (len(whole.targets) + whole.orientation)))
        places = places_of(arm, used, whole)[arm.frame_unknowns :] - arm.frame_unknowns
        found[:, places] = residual
        return replace(data, targets=np.concatenate([data.targets, empty], axis=1)), found

    @cached_property
    def _old_targets(self) -> tuple[int, ...]:
        """Targets of the calibration that were not measured now."""
        now = self.scene.task.selection.targets
        return tuple(target for target in self.calibration.selection.targets if target not in now)

    @property
    def _old_turn(self) -> bool:
        """Whether orientations took part in the calibration and were not measured now."""
        return self.calibration.selection.orientation and not self.scene.task.selection.orientation

    @cached_property
    def _kept(self) -> dict[int, int]:
        """Set-ups whose tool is where it was, and their numbers in the calibration."""
        unknowns, groups = self.scene.unknowns, self.scene.task.groups
        return {
            k: number
            for k, number in enumerate(unknowns.known)
            if number is not None
            and groups[k] not in self.moved
            and not (unknowns.tool & unknowns.anew)[unknowns.group(k)].any()
        }

    @property
    def _width(self) -> int:
        """Unknowns of each of these set-ups."""
        task = replace(task_of(self.calibration), selection=self.selection, groups=self.scene.task.groups)
        return setup_unknowns(task) // len(task.groups)

    @cached_property
    def _among(self) -> Floats:
        """One where an unknown of what was measured now stands among those of these set-ups (S, S')."""
        places = places_of(self.calibration.arm, self.scene.task.selection, self.selection)
        one = np.zeros((self._width, len(places)))
        one[places, np.arange(len(places))] = 1.0
        return np.asarray(np.kron(np.eye(len(self.scene.task.groups)), one), dtype=np.float64)

    def _with_arm(self, size: int) -> Floats:
        """The same, with the unknowns of the arm in front; `size` is that of all unknowns of the update."""
        return np.asarray(block_diag(np.eye(size - self._among.shape[1]), self._among))
