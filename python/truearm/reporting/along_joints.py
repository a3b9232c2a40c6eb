"""Figures: errors along each joint, and the stretches where they stand out of what chance makes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from truearm.judgement.held_rows import HeldRows
from truearm.reporting.charts import axis, legend, line, log_axis, points, running_median, stretches
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed, short
from truearm.reporting.parts import Figure
from truearm.types import Floats, Mask, Rows

DRAWN: Final = 1500
"""More points than these are not told apart."""
BINS: Final = 12
FEWEST_IN_BIN: Final = 8
FEWEST_STRETCHES: Final = 3
"""Medians over a joint that are compared, and joined by a line."""
STANDS_OUT: Final = 1.35
"""A stretch of a joint whose median error is so many times that of all is worth a word."""
SURE: Final = 0.98
"""Share of all orders of the errors in which no joint's stretches differ so much."""
ORDERS: Final = 400
"""That are drawn to tell it."""
SEED: Final = 0
SMALLEST: Final = 1e-4
"""In mm or mrad: smaller errors are drawn there."""


@dataclass(frozen=True, eq=False)
class AlongJoints:
    """Errors of p judged poses; of a pose that was measured several times it is their mean.

    Attributes:
        readings: In deg and mm (p, N).
        errors: Lengths of the errors of each model (p,), mm, NaN where not measured.
        units: Of each joint's readings.
        best: Name of the model that predicts.
    """

    readings: Floats
    errors: Mapping[str, Floats]
    units: tuple[str, ...]
    best: str

    @classmethod
    def of(cls, facts: Facts, held: HeldRows) -> "AlongJoints":
        """Those of a calibration."""
        _, first = np.unique(held.poses, return_index=True)
        return cls(
            readings=facts.shown(held.readings[first]),
            errors={name: held.by_pose(facts.errors_mm[name]) for name in facts.models},
            units=tuple(map(facts.unit, range(len(facts.joints)))),
            best=facts.best,
        )

    def figure(self, joint: int) -> Figure:
        """Error over the readings of one joint, counted from 0."""
        q = self.readings[:, joint]
        traces, shown = [], {}
        for model, errors in self.errors.items():
            known = np.isfinite(errors)
            _, middles, medians = running_median(q[known], errors[known], BINS, FEWEST_IN_BIN)
            has_line = len(middles) >= FEWEST_STRETCHES
            if model == self.best or not has_line:
                single = drawable(errors)[:DRAWN]
                look = {"faint": has_line, "showlegend": not has_line}
                traces.append(points(q[known][:DRAWN], single, model, **look))
                shown[f"{model}, points"] = single
            if has_line:
                traces.append(line(middles, medians, model))
                shown[model] = drawable(medians)
        return Figure(
            f"Error along joint {joint + 1}",
            self.where(joint),
            traces,
            legend(
                xaxis=axis(f"joint {joint + 1}, {self.units[joint]}"),
                yaxis=log_axis("position error, mm (logarithmic)", *ends(shown)),
            ),
            height=290,
        )

    def where(self, joint: int) -> str:
        """Where along a joint the median error stands out."""
        q, errors = self._known
        edges, _, medians = running_median(q[:, joint], errors, BINS, FEWEST_IN_BIN)
        overall, worst = float(np.median(errors)), int(np.argmax(medians))
        here, everywhere = short(float(medians[worst]), overall)
        if len(medians) < FEWEST_STRETCHES:
            return f"Too few poses to compare stretches of the joint; the median is {everywhere} mm."
        compared = f"the largest median of one is {here} mm, that of all poses {everywhere} mm."
        if medians[worst] < STANDS_OUT * overall:
            return f"No stretch of the joint stands out: {compared}"
        if not self._differ[joint]:
            return f"No stretch of the joint stands out beyond chance: {compared}"
        stretch = f"{fixed(edges[worst], 0)} and {fixed(edges[worst + 1], 0)} {self.units[joint]}"
        return f"Largest between {stretch}: the median there is {here} mm, that of all poses {everywhere} mm."

    @property
    def _known(self) -> tuple[Floats, Floats]:
        """Readings (k, N) and errors (k,) of the model that predicts, where these are known."""
        known = np.isfinite(self.errors[self.best])
        return self.readings[known], self.errors[self.best][known]

    @cached_property
    def _differ(self) -> Mask:
        """Whether stretches of each joint differ by more than chance makes of any joint (N,).

        Where errors have nothing to do with joints, they could as well stand in any other order. Kruskal and
        Wallis's sum over all stretches is asked, as the largest median of few poses each hardly tells.
        """
        q, errors = self._known
        shares = [stretches(column, BINS, FEWEST_IN_BIN)[1] for column in q.T]
        ranks: Floats = np.argsort(np.argsort(errors)).astype(np.float64) - 0.5 * (len(errors) - 1)
        rng = np.random.default_rng(SEED)
        largest = [_apart(ranks[rng.permutation(len(ranks))], shares).max() for _ in range(ORDERS)]
        return np.asarray(_apart(ranks, shares) > np.quantile(largest, SURE))


def _apart(ranks: Floats, shares: Sequence[Rows]) -> Floats:
    """How far apart stretches of each joint are (N,), in standard deviations of what chance makes.

    Args:
        ranks: Of the errors (k,), of mean zero.
        shares: Stretch of each error along each joint (k,), from 0.
    """
    found = []
    for place in shares:
        counts, sums = np.bincount(place), np.bincount(place, ranks)
        freedom = max(len(counts) - 1, 1)
        found.append((np.sum(sums**2 / counts) / np.var(ranks) - freedom) / np.sqrt(2.0 * freedom))
    return np.array(found)


def drawable(errors: Floats) -> Floats:
    """Errors (n,) that are known, as a logarithmic axis can show them (k,)."""
    return np.maximum(errors[np.isfinite(errors)], SMALLEST)


def ends(known: Mapping[str, Floats]) -> tuple[float, float]:
    """Of a logarithmic axis of errors."""
    values = np.concatenate(list(known.values()))
    return float(np.quantile(values, 0.002)) / 1.1, float(values.max()) * 1.1
