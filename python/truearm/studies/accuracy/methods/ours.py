"""The variable model of truearm, and what each of its blocks adds to those before it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from truearm.fits.fitting import Fits, Hyper, KnownHyper, Task, fit_rows
from truearm.fits.models import VARIABLE
from truearm.intervals import interval_coverage
from truearm.studies.accuracy.fitted import Fitted, FittedArm
from truearm.studies.accuracy.methods.searching import Effort
from truearm.studies.accuracy.poses import Prepared

OURS: Final = "ours"
FIRST_BLOCK: Final = "own"
FURTHER_BLOCKS: Final = ("smooth", "major", "wrist", "sag", "waves")
"""Blocks in the order in which they are added to the first."""
PARTS: Final = {f"{OURS}-{block}": block for block in (FIRST_BLOCK, *FURTHER_BLOCKS[:-1])}
"""The last block of each part of the model; with the last of all it is whole."""
SWITCHED_OFF: Final = 1e-9
"""Amplitude of a block that is not to matter, in rad and m, or rad a metre."""
WITH_AMPLITUDES: Final = ("smooth", "sag")
"""Blocks that every field has, so that they are switched off rather than left out."""


def fit_variable(prepared: Prepared, _: Effort) -> Mapping[str, Fitted]:
    """Ours by `truearm calibrate --drift none`; and its parts: the same scales, with some of the blocks."""
    task = replace(prepared.task, options=replace(prepared.task.options, model=VARIABLE))
    fits = fit_rows(task, prepared.train)
    covered = None if prepared.cell.cut.target else interval_coverage(task, fits, prepared.held)
    hyper = {} if fits.variable is None else fits.variable.hyper
    major = [int(joint) + 1 for joint in hyper.get("major_joints", ())]
    found: dict[str, Fitted] = {OURS: FittedArm(fits.models(task.arm)[VARIABLE], {"major": major}, covered)}
    fitted = found[OURS]
    for part, block in zip(reversed(PARTS), reversed(FURTHER_BLOCKS), strict=True):
        fewer = _without(hyper, block)
        if fewer != hyper:
            fitted, hyper = _part(task, prepared, fewer), fewer
        found[part] = fitted
    return found


def _without(hyper: Hyper, block: str) -> Hyper:
    """The hyper-parameters of a field that lacks one of its blocks; as they are where it has none."""
    if block in WITH_AMPLITUDES:
        return {
            name: [SWITCHED_OFF] * len(values) if name == block else values for name, values in hyper.items()
        }
    return {
        name: values for name, values in hyper.items() if name != block and not name.startswith(f"{block}_")
    }


def _part(task: Task, prepared: Prepared, hyper: Hyper) -> Fitted:
    """The posterior with these hyper-parameters."""
    fits: Fits = fit_rows(task, prepared.train, KnownHyper(hyper))
    return FittedArm(fits.models(task.arm)[VARIABLE])
