"""Chapter: repeatability, hysteresis and noise floor, where poses were measured more than once."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import count_of
from truearm.measurements import Measurements
from truearm.reporting.charts import axis
from truearm.reporting.drifts import drifts
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed, lean, listed, short
from truearm.reporting.parts import Figure, Part, Section, Table, Text
from truearm.rows.visits import pose_numbers, visit_numbers
from truearm.simulation import approach_in_sequence
from truearm.storage.summary import states_sigma, whole_noise_mm
from truearm.tables.columns import APPROACH, REPEAT
from truearm.types import Floats
from truearm.units import MM_PER_METRE

Index = NDArray[np.int64]

FEWEST_GROUPS: Final = 3
SURE: Final = 3.0
"""Standard deviations by which the square of a difference exceeds what scatter makes, where it stands out."""
COORDINATES: Final = 3


@dataclass(frozen=True, eq=False)
class Repeats:
    """Rows in their order of measuring, with the pose that each belongs to.

    Attributes:
        place: Number of the pose (n,); rows of one set-up that were read at the same pose share it.
        missed: Measured minus what is predicted at the reading of the pose's first row (n, 3), m, what
            drifted taken out.
        approach: Sign of each joint's last movement (n, N).
        stayed: Whether a row came right after another of its pose (n,), and was not planned to repeat it: the
            arm may have stood still.
        stated: Whether the rows say themselves from which side all joints came.
    """

    place: Index
    missed: Floats
    approach: Floats
    stayed: NDArray[np.bool_]
    stated: bool

    @classmethod
    def of(cls, facts: Facts) -> "Repeats | None":
        """Those of the rows that were fitted, at the target that most hold; None where there are none."""
        rows, selection = facts.calibration.rows, facts.calibration.selection
        if rows is None or selection.distances:
            return None
        data = rows.data
        target = data.most_held(selection.targets)
        which = selection.targets.index(target)
        seen = np.flatnonzero(data.seen(target))
        order = seen[np.lexsort((data.rows[seen], data.sources[seen]))]
        stated = _stated_approach(data)
        approach = (_approach(data) if stated is None else stated)[order]
        place = pose_numbers(data.readings[order], data.group[order])
        again = np.bincount(place)[place] > 1
        if not again.any():
            return None
        missed = rows.residual[order][:, 3 * which : 3 * which + 3]
        here, there = order[again], order[place[again]]
        moved = _predicted(facts, data, here, which) - _predicted(facts, data, there, which)
        stayed = _stayed(data, order, place)
        if stated is not None:
            stayed &= approach[:, 0] == np.roll(approach[:, 0], 1)
        return cls(place[again], missed[again] + moved, approach[again], stayed[again], stated is not None)

    def distances_mm(self) -> Floats:
        """Distance of each row from the mean of its pose (n,), mm."""
        found = np.empty(len(self.place))
        for mine in self.poses():
            found[mine] = np.linalg.norm(self.missed[mine] - self.missed[mine].mean(axis=0), axis=1)
        return MM_PER_METRE * found

    def widened(self) -> Floats:
        """How much farther rows lie from the true mean than from that of the k rows of their pose (n,)."""
        count = np.bincount(self.place)[self.place]
        return np.asarray(np.sqrt(count / (count - 1)))

    def poses(self) -> Iterator[Index]:
        """Rows of each pose."""
        for place in np.unique(self.place):
            yield np.flatnonzero(self.place == place)

    def both_sides_mm(self, joint: int, noise_mm: float) -> tuple[Floats, Floats]:
        """For each pose that a joint reached from both sides: how far the two means lie apart, and what the
        scatter within the sides would make of it, mm; the noise of a coordinate where each side has one row.
        """
        apart, scatter = [], []
        noise = COORDINATES * (noise_mm / MM_PER_METRE) ** 2
        for mine in self.poses():
            sides = [self.missed[mine[self.approach[mine, joint] == sign]] for sign in (-1.0, 1.0)]
            if min(map(len, sides)) == 0:
                continue
            apart.append(np.linalg.norm(sides[1].mean(axis=0) - sides[0].mean(axis=0)))
            freedom = sum(len(side) - 1 for side in sides)
            squares = sum(float(np.square(side - side.mean(axis=0)).sum()) for side in sides)
            alone = squares / freedom if freedom else noise
            scatter.append(np.sqrt(alone * sum(1.0 / len(side) for side in sides)))
        return MM_PER_METRE * np.array(apart), MM_PER_METRE * np.array(scatter)


def repeats(facts: Facts) -> Section:
    """What repeated poses say."""
    title = "Repeatability and noise"
    per = "per distance" if facts.calibration.selection.distances else "per coordinate"
    floor, whole, noise = short(facts.floor_mm, whole_noise_mm(facts.calibration), facts.summary["noise_mm"])
    beyond = (
        f"{noise} mm {per} beyond what rows state as their sigma, {whole} mm with it"
        if states_sigma(facts.calibration)
        else f"{noise} mm {per}"
    )
    parts: list[Part] = [
        Text(
            f"The residual that the {facts.best} model does not explain has a standard deviation of {beyond}"
            f"; alone it would make a mean error of {floor} mm. It comprises noise of the measuring "
            "device, what the arm does not repeat, and what the model cannot represent."
        )
    ]
    found = Repeats.of(facts)
    if found is None:
        parts.append(Text(_nothing(facts)))
    else:
        parts += [scatter(facts, found), *hysteresis(facts, found)]
    return Section(title, [*parts, *drifts(facts)])


def _nothing(facts: Facts) -> str:
    if facts.calibration.rows is None:
        return "The measurements were left out of this file, so repeated poses cannot be examined."
    if facts.calibration.selection.distances:
        return "Distances were measured, not points: they do not show how poses repeat."
    return (
        "No pose was measured twice, so these data do not show repeatability and hysteresis. Some poses "
        "measured several times, approached from both sides, would."
    )


def scatter(facts: Facts, found: Repeats) -> Figure:
    """How far repeated measurements lie from their centres."""
    distances = found.distances_mm()
    mean, spread = float(distances.mean()), float(distances.std(ddof=1)) if len(distances) > 1 else 0.0
    free = float((distances * found.widened()).mean())
    texts = short(mean, mean + 3.0 * spread, free)
    times = (
        " The mean of few measurements is drawn towards them: from the mean of many they would lie "
        f"{texts[2]} mm on average. The {facts.mean_error} on {facts.judged} poses is "
        f"{facts.mean_mm() / free:.1f} times that."
        if free > 0.0
        else ""
    )
    poses = len(np.unique(found.place))
    moved = facts.calibration.validation.drift is not None
    steady = " What the set-up moved while it was measured is taken out of this." if moved else ""
    trace = {
        "type": "histogram",
        "x": lean(distances),
        "nbinsx": 40,
        "marker": {"color": "@variable"},
    }
    return Figure(
        "How well poses repeat",
        f"{len(distances)} measurements of {count_of(poses, 'pose')} lie {texts[0]} mm from the mean of "
        f"their pose on average; mean plus three standard deviations is {texts[1]} mm.{times}{steady}"
        f"{_standing(found)}",
        [trace],
        {
            "xaxis": axis("distance from the mean of the pose, mm", rangemode="tozero"),
            "yaxis": axis("measurements"),
            "bargap": 0.05,
        },
        height=280,
    )


def _standing(found: Repeats) -> str:
    """Said where poses were read several times in a row."""
    if not found.stayed.any():
        return ""
    poses = len(np.unique(found.place))
    count = int(found.stayed.sum())
    which = "All" if count == len(found.stayed) - poses else str(count)
    return (
        f" {which} of the repeats came right after another measurement of their pose: if the arm stood still "
        "in between, they show how the instrument repeats, not how the arm does."
    )


def hysteresis(facts: Facts, found: Repeats) -> list[Table]:
    """How far poses lie apart that a joint, or all as rows say themselves, reached from both sides."""
    rows, beyond, counts = list[list[str]](), list[str](), list[int]()
    noise = whole_noise_mm(facts.calibration)
    names = ["all joints"] if found.stated else [f"joint {joint + 1}" for joint in range(len(facts.joints))]
    for joint, name in enumerate(names):
        apart, alone = found.both_sides_mm(joint, noise)
        if len(apart) < FEWEST_GROUPS:
            continue
        both, expected = (float(np.sqrt(np.square(values).mean())) for values in (apart, alone))
        counts.append(len(apart))
        rows.append([name, str(len(apart)), fixed(both), fixed(expected)])
        if both > expected * np.sqrt(1.0 + SURE * np.sqrt(2.0 / (COORDINATES * len(apart)))):
            beyond.append(f"{name} ({fixed(both)} mm)")
    if not rows:
        return []
    table = Table(
        "Poses approached from both sides",
        ["", "poses", "difference of the sides, mm", "expected from scatter, mm"],
        rows,
        says=f"{_beyond(beyond, counts, stated=found.stated)} Both columns are root mean squares; scatter is "
        f"that within the sides, and the calibration's noise of {fixed(noise)} mm per coordinate where each "
        "has one measurement. "
        + (
            f"The column {APPROACH} says from which side all joints came."
            if found.stated
            else "The order of the rows is taken for the order of measuring."
        ),
    )
    return [table]


def _beyond(joints: list[str], counts: list[int], *, stated: bool) -> str:
    """Which joints' sides lie farther apart than scatter and chance make them.

    Args:
        joints: Those whose sides do.
        counts: How many poses tell, of each joint that was looked at.
        stated: Whether rows state the side, which is then of all joints.
    """
    few = " to ".join(str(count) for count in dict.fromkeys((min(counts), max(counts))))
    chance = f"than scatter and chance may make of {few} poses"
    if stated:
        return f"The sides lie {'farther' if joints else 'no farther'} apart {chance}."
    if not joints:
        return f"No joint's sides lie farther apart {chance}."
    one = (
        " Joints that came from the other side in the same poses share what one of them does."
        if len(joints) > 1
        else ""
    )
    return f"Farther apart {chance} lie the sides of {listed(joints)}.{one}"


def _predicted(facts: Facts, data: Measurements, rows: Index, which: int) -> Floats:
    """Where one of the fitted targets is predicted in some rows (n, 3), base frame, m."""
    calibration = facts.calibration
    points = np.empty((len(rows), 3))
    for number, group in enumerate(calibration.groups):
        mine = data.group[rows] == group
        own = data.select(rows[mine])
        points[mine] = calibration.position(
            own.readings,
            tool=calibration.model.setup.targets[number, which],
            features={name: own.features[name].to_numpy() for name in calibration.options.features},
        )
    return points


def _stayed(data: Measurements, order: Index, place: Index) -> NDArray[np.bool_]:
    """Whether each row in the order of measuring came right after one of its pose, unplanned (n,)."""
    before = np.roll(np.arange(len(order)), 1)
    source, number = data.sources[order], data.rows[order]
    unplanned = np.ones(len(order), bool) if data.purpose is None else data.purpose[order] != REPEAT
    follows = (source == source[before]) & (number == number[before] + 1)
    return np.asarray((place == place[before]) & follows & unplanned)


def _stated_approach(data: Measurements) -> Floats | None:
    """The side that rows say all joints came from (n, N), zero where none; None where they do not say."""
    if APPROACH not in data.features.columns:
        return None
    sides = data.features[APPROACH].to_numpy(dtype=np.float64)
    if not np.isin(sides, (1.0, -1.0, 0.0)).all() or not {1.0, -1.0} <= set(sides):
        return None
    return np.repeat(sides[:, None], data.joint_count, axis=1)


def _approach(data: Measurements) -> Floats:
    """Signs (n, N) of each joint's last movement, the rows of each file one after another."""
    approach = np.zeros((len(data), data.joint_count))
    for source in data.files:
        own = np.flatnonzero(data.sources == source)
        own = own[np.argsort(data.rows[own], kind="stable")]
        visits = visit_numbers(data.readings[own], data.group[own])
        _, first = np.unique(visits, return_index=True)
        approach[own] = approach_in_sequence(data.readings[own[first]])[visits]
    return approach
