"""The variable model of truearm, and what each kind of block adds to it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from truearm.fitting import Fits, Hyper, KnownHyper, Task, fit_rows
from truearm.intervals import interval_coverage
from truearm.models import VARIABLE
from truearm.studies.accuracy.fitted import Fitted, FittedArm
from truearm.studies.accuracy.methods.searching import Effort
from truearm.studies.accuracy.poses import Prepared

OURS: Final = "ours"
OWN: Final = "ours-own"
OWN_SMOOTH: Final = "ours-own-smooth"
SWITCHED_OFF: Final = 1e-9
"""Amplitude in rad or m of a block that is not to matter."""
SMOOTH_KEYS: Final = ("smooth",)
PRODUCT_KEYS: Final = ("major_amplitudes", "wrist_amplitudes")


def fit_variable(prepared: Prepared, _: Effort) -> Mapping[str, Fitted]:
    """Ours by `truearm calibrate --drift none`; and its parts: the same scales, but blocks switched off."""
    task = replace(prepared.task, options=replace(prepared.task.options, model=VARIABLE))
    fits = fit_rows(task, prepared.train)
    covered = None if prepared.cell.cut.target else interval_coverage(task, fits, prepared.held)
    hyper = {} if fits.variable is None else fits.variable.hyper
    major = [int(joint) + 1 for joint in hyper.get("major_joints", ())]
    whole = FittedArm(fits.models(task.arm)[VARIABLE], {"major": major}, covered)
    return {
        OURS: whole,
        OWN: _part(task, prepared, hyper, (*SMOOTH_KEYS, *PRODUCT_KEYS)),
        OWN_SMOOTH: _part(task, prepared, hyper, PRODUCT_KEYS),
    }


def _part(task: Task, prepared: Prepared, hyper: Hyper, off: Sequence[str]) -> Fitted:
    """The posterior of the same scales without the blocks whose amplitudes are `off`."""
    changed = {
        name: [SWITCHED_OFF] * len(values) if name in off else values for name, values in hyper.items()
    }
    fits: Fits = fit_rows(task, prepared.train, KnownHyper(changed))
    return FittedArm(fits.models(task.arm)[VARIABLE])
