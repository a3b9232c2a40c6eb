"""Whether the readings of joints stand on a grid, between whose values nothing is seen."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.doubts.few_values import few_values
from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

SHOWN: Final = {"revolute": 1.0 / RADIANS_PER_DEGREE, "prismatic": MM_PER_METRE}
FEWEST_ROWS: Final = 30
FEWEST_VALUES: Final = 4
FINEST: Final = {"revolute": 0.5, "prismatic": 2.0}
"""Deg, mm: gears and encoders leave up to 520 cycles a turn, screws one in some millimetres, and readings on
a finer grid than this show most of them."""
JITTER: Final = 0.1
"""How far from its value of the grid a controller may have stopped, deg or mm."""
SHARE: Final = 0.98
"""Of the rows that have to stand on the grid: more off it show what lies between its values."""
MOST_AT_ONE: Final = 0.5
"""Of the rows that one value may hold: a joint that mostly stands still stands on no grid."""
CHANCE: Final = 0.01
"""How likely as few values as these may fall on some grid at random."""
OF_A_GAP: Final = 0.5
"""Part of the least gap of a few values below which a step is that of round numbers, and no grid."""
BIN: Final = 0.05
"""Deg or mm."""
MOST_BINS: Final = 1 << 18
"""Rails of more than ten metres have wider bins."""
FINER: Final = 8
"""Steps that are tried lie so close that their grids differ by a part of this of a step at the far end."""
ALIKE: Final = 0.9
"""Share of the rows on a grid from which it is the one in question, and none of the finer ones."""
BETWEEN: Final = (
    "Measure 20 to 30 poses between the values of the grid and judge on them with truearm evaluate; truearm "
    "plan chooses poses that stand on no grid"
)
"""The way out."""


def grid_steps(readings: Floats, joints: Sequence[str]) -> dict[int, float]:
    """Steps of the grids that joints stand on, deg or mm, by the number of the joint from 1.

    A few values that stand on one because they are round numbers are no grid.

    Args:
        readings: Joint readings (n, N), rad or m.
        joints: Kind of each joint.
    """
    if len(readings) < FEWEST_ROWS:
        return {}
    few = few_values(readings, joints)
    found = {
        joint: _step(readings[:, joint - 1] * SHOWN[kind], FINEST[kind])
        for joint, kind in enumerate(joints, start=1)
    }
    return {
        joint: step
        for joint, step in found.items()
        if step is not None and not (joint in few and step < OF_A_GAP * np.diff(few[joint]).min())
    }


def grid_words(steps: Mapping[int, float], joints: Sequence[str]) -> str:
    """Grids of joints, of which there must be one, in words: "joints 1 and 2 on a grid of 10 deg"."""
    by_step: dict[str, list[str]] = {}
    for joint, step in steps.items():
        unit = "mm" if joints[joint - 1] == "prismatic" else "deg"
        shown = f"{step:.3g}" if step < 999.5 else f"{step:.0f}"
        by_step.setdefault(f"{shown} {unit}", []).append(str(joint))
    return ", ".join(
        f"joint{'s' if len(numbers) > 1 else ''} {', '.join(numbers[:-1])}"
        f"{' and ' if len(numbers) > 1 else ''}{numbers[-1]} on a grid of {step}"
        for step, numbers in by_step.items()
    )


def _step(readings: Floats, finest: float) -> float | None:
    """The largest step of a grid that readings (n,) stand on, deg or mm; None where there is none.

    It is looked for in what lies together: the few that may be off the grid may be far away.
    """
    low, high = np.quantile(readings, [(1.0 - SHARE) / 2.0, (1.0 + SHARE) / 2.0])
    span = float(high - low)
    if span < (FEWEST_VALUES - 1) * finest:
        return None
    wide = max(BIN, span / MOST_BINS)
    within = readings[(readings >= low) & (readings <= high)]
    counts = np.bincount(np.rint((within - low) / wide).astype(np.int64))
    length = 1 << (FINER * len(counts) - 1).bit_length()
    per_unit = np.arange(length // 2 + 1) / (length * wide)
    likeness = np.abs(np.fft.rfft(counts, length)) / len(within)
    least, most = (FEWEST_VALUES - 1) / (span + JITTER), 1.0 / finest + 1.0 / span
    tried = np.flatnonzero((likeness > ALIKE) & (per_unit >= least) & (per_unit <= most))
    peaks = [k for k in tried if likeness[k] >= max(likeness[k - 1], likeness[k + 1])]
    fits = (_fitted(within - low, readings - low, 1.0 / float(per_unit[k])) for k in peaks)
    found = next((fit for fit in fits if fit[1] > ALIKE), None)
    if found is None:
        return None
    step, share, counts = found
    likely = 2.0 * span / step * (2.0 * JITTER / step) ** (len(counts) - 2)
    varied = len(counts) >= FEWEST_VALUES and counts.max() <= MOST_AT_ONE * len(readings)
    return step if share >= SHARE and varied and likely < CHANCE else None


def _fitted(within: Floats, places: Floats, step: float) -> tuple[float, float, NDArray[np.int64]]:
    """The step that fits places `within` (m,) best, what share of all (n,) stand there, and how many on each.

    Those that are off the grid pull at the first line through it; the second is through the others.
    """
    turned = np.exp(2j * np.pi * within / step).mean()
    first, on = step * float(np.angle(turned)) / (2.0 * np.pi), np.ones(len(within), dtype=np.bool_)
    for _ in range(2):
        numbers = np.rint((within - first) / step)
        basis = np.stack([np.ones_like(numbers), numbers], axis=1)
        if np.ptp(numbers[on]) == 0.0:
            return step, 0.0, np.empty(0, dtype=np.int64)
        first, step = np.linalg.lstsq(basis[on], within[on], rcond=None)[0].tolist()
        left = np.abs(within - first - step * numbers)
        on = left <= max(2.0 * JITTER, float(np.median(left)))
    numbers = np.rint((places - first) / step)
    stands = np.abs(places - first - step * numbers) <= JITTER
    return step, float(stands.mean()), np.unique(numbers[stands], return_counts=True)[1]
