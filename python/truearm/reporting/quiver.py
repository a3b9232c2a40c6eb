"""Figure: the errors as arrows in space with the arm drawn, before and after."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.fits.models import CONSTANT, NOMINAL
from truearm.judgement.held_rows import HeldRows
from truearm.reporting.arm_drawing import arm_traces
from truearm.reporting.facts import Facts
from truearm.reporting.held_errors import vectors_mm
from truearm.reporting.numbers import fixed, lean, short
from truearm.reporting.parts import Choice, Figure
from truearm.reporting.style import colour_of
from truearm.types import Floats
from truearm.units import MM_PER_METRE

MOST_ARROWS: Final = 400
SHARE_OF_REACH: Final = 0.12
"""Length of a large nominal error in parts of the workspace."""
LONGER: Final = 10
SHARED: Final = 0.3
"""Errors whose mean vector is longer than this part of their mean length share a direction."""
BY_CHANCE: Final = 2.3
"""Times their root mean square over the root of the number of poses: random errors hardly have so long a mean
vector, in 2 of 100 sets at the most, where all of them point along one axis.
"""
ROUND: Final = (1, 2, 5)
MARGIN: Final = 0.02
"""Of the axes' ranges, on either side."""
CAMERA: Final = {"eye": {"x": 1.2, "y": -1.4, "z": 0.6}, "center": {"x": 0.0, "y": 0.0, "z": 0.0}}
"""Where the picture is seen from; the page steps back until all of it is in view."""


def quiver(facts: Facts) -> Figure | None:
    """Arrows from where the nominal model has the point to where a model misses it, much longer than true."""
    held = facts.held
    if held is None:
        return None
    robot = facts.calibration.robot
    flange = robot.flange_chain.pose(robot.joints_from_readings(held.readings))
    places = MM_PER_METRE * (flange[:, :3, :3] @ facts.point + flange[:, :3, 3])
    seen = np.flatnonzero(np.isfinite(held.errors[NOMINAL].position).all(axis=1))[:MOST_ARROWS]
    scale = _scale(places[seen], vectors_mm(held, NOMINAL)[seen])
    traces = arm_traces(robot, facts.typical, facts.point)
    labels = []
    states = _states(facts)
    for label, model, times in states:
        traces.append(_arrows(held, model, places, seen, scale * times))
        labels.append(f"{label}, {scale * times}:1")
    fixed_traces = len(traces) - len(states)
    shown = [[True] * fixed_traces + [j == k for j in range(len(states))] for k in range(len(states))]
    return Figure(
        "Errors in space, enlarged",
        _says(facts, held),
        traces,
        {
            "scene": {
                **{f"{name}axis": {"title": {"text": f"{name}, mm"}} for name in "xyz"},
                "camera": CAMERA,
                "aspectmode": "manual",
            },
            "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        },
        height=520,
        is_wide=True,
        choices=[
            Choice(
                label,
                which,
                {"scene": _box([trace for trace, is_in in zip(traces, which, strict=True) if is_in])},
            )
            for label, which in zip(labels, shown, strict=True)
        ],
    )


def _box(traces: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Axes that hold all of some traces, and the sides of their box in parts of its size.

    The page needs the sides to see all of the box.
    """
    found: dict[str, Any] = {}
    sides = {}
    for name in "xyz":
        values = np.array([value for trace in traces for value in trace[name] if value is not None])
        margin = MARGIN * float(np.ptp(values)) or 1.0
        low, high = float(values.min()) - margin, float(values.max()) + margin
        found[f"{name}axis"] = {"range": lean([low, high])}
        sides[name] = high - low
    size = float(np.prod(list(sides.values())) ** (1.0 / len(sides)))
    return found | {"aspectratio": {name: side / size for name, side in sides.items()}}


def _states(facts: Facts) -> list[tuple[str, str, int]]:
    """Label, model and magnification of each state; nominal and best come first."""
    best = facts.best
    states = [(NOMINAL, NOMINAL, 1), (best, best, 1)]
    states += [("constant", CONSTANT, 1)] if best != CONSTANT else []
    return [*states, (best, best, LONGER)]


def _scale(places: Floats, vectors: Floats) -> int:
    """A round magnification that makes large nominal errors an eighth of the workspace; 1 for one place."""
    reach = float(np.ptp(places, axis=0).max())
    large = float(np.quantile(np.linalg.norm(vectors, axis=1), 0.9))
    if reach == 0.0:
        return 1
    wanted = SHARE_OF_REACH * reach / max(large, 1e-9)
    known: list[int] = [mantissa * pow(10, power) for power in range(7) for mantissa in ROUND]
    return min(known, key=lambda value: abs(float(np.log(value / wanted))))


def _arrows(
    held: HeldRows, model: str, places: Floats, seen: NDArray[np.int64], scale: int
) -> dict[str, Any]:
    """Line pieces with a dot at their heads."""
    vectors = vectors_mm(held, model)[seen]
    tails, heads = places[seen], places[seen] + scale * vectors
    gaps = np.full_like(tails, np.nan)
    pieces = np.stack([tails, heads, gaps], axis=1).reshape(-1, 3)
    lengths = np.linalg.norm(vectors, axis=1)
    words = [f"row {row}: {fixed(length)} mm" for row, length in zip(held.rows[seen], lengths, strict=True)]
    return {
        "type": "scatter3d",
        "name": model,
        "mode": "lines+markers",
        **{name: lean(pieces[:, k]) for k, name in enumerate("xyz")},
        "text": [text for word in words for text in (word, word, "")],
        "hoverinfo": "text",
        "line": {"color": colour_of(model), "width": 3},
        "marker": {"color": colour_of(model), "size": [0, 3.5, 0] * len(seen), "line": {"width": 0}},
    }


def _says(facts: Facts, held: HeldRows) -> str:
    """Whether the errors point one way, before and after."""
    kept = held.without(facts.summary["outliers"] if facts.leaves_outliers_out else [])
    found = [np.where(kept[:, None], vectors_mm(held, model), np.nan) for model in (NOMINAL, facts.best)]
    lengths = [np.linalg.norm(vectors, axis=1) for vectors in found]
    of_poses = held.by_pose(found[1])
    of_poses = of_poses[np.isfinite(of_poses).all(axis=1)]
    mean, told = float(np.linalg.norm(of_poses.mean(axis=0))), shared_direction(of_poses)
    texts = short(*(float(np.nanmean(each)) for each in lengths), mean)
    return (
        f"The {facts.mean_error} is {texts[0]} mm with the nominal model and {texts[1]} mm with the "
        f"{facts.best} one; the mean of its error vectors is {texts[2]} mm long: they {told}. "
        "The arm is drawn in a pose near the middle of the measured ones."
    )


def shared_direction(vectors: Floats) -> str:
    """Whether errors of poses (p, 3) share a direction, in words, by more than chance."""
    lengths = np.linalg.norm(vectors, axis=1)
    mean = np.linalg.norm(vectors.mean(axis=0))
    if mean < SHARED * lengths.mean():
        return "share no direction"
    if mean < BY_CHANCE * np.sqrt(np.square(lengths).mean() / len(vectors)):
        return "share no direction beyond chance"
    return "share a direction"
