"""Figures: slices of the `major` block, where parameters vary over several joints together."""

from typing import Any, Final

import numpy as np

from truearm._core import Field
from truearm.fits.stillness import still_joints, still_words
from truearm.reporting.axes import JointAxis, ends, input_axis, places, readings_at
from truearm.reporting.charts import axis, heatmap
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed, listed
from truearm.reporting.parameters import effect_mm
from truearm.reporting.parts import Choice, Figure, Part, Text
from truearm.reporting.style import DIVERGING
from truearm.types import Floats

BLOCK: Final = "major"
GRID: Final = 28
SLICES: Final = 3
PARAMETERS: Final = 2


def slices(facts: Facts) -> list[Part]:
    """The block over its first two joints at three places of its third, and its largest parameters.

    Joints that stood still are no axes; without two others there is a sentence in place of the figures.
    """
    field = facts.calibration.model.field
    blocks = [] if field is None else [block for block in field.blocks() if block["name"] == BLOCK]
    joints = len(facts.joints)
    if field is None or not blocks or len(blocks[0]["inputs"]) < 2 or max(blocks[0]["inputs"]) >= joints:
        return []
    inputs = list(blocks[0]["inputs"])
    spans = np.array([ends(facts, input_axis(facts, joint)) for joint in range(joints)])
    still = {k: at for k, at in still_joints(spans.T, facts.joints).items() if k - 1 in inputs}
    moving = [joint for joint in inputs if joint + 1 not in still]
    stood = f"In the `{BLOCK}` block, {still_words(still, facts.joints)} stood still" if still else ""
    if len(moving) < 2:
        return [Text(f"{stood}: there are no two joints to show it over.", is_note=True)]
    alone = Field(field.input_count, field.parameter_count, blocks, facts.calibration.arm.flange_chain)
    cut = Cut(facts, alone, moving, f" {stood}." if stood else "")
    order = np.argsort(-cut.effects.max(axis=0))[:PARAMETERS]
    return [cut.moved(), *(cut.parameter(int(column)) for column in order)]


class Cut:
    """A block on a grid over two joints, at three places of a third if there is one, less its means there."""

    def __init__(self, facts: Facts, alone: Field, joints: list[int], besides: str) -> None:
        """Ask the block alone; `besides` is said of it."""
        self.facts, self.besides = facts, besides
        self.inputs = [input_axis(facts, joint) for joint in joints]
        self.axes = [places(facts, along, GRID) for along in self.inputs[:2]]
        self.places = self._places()
        values = np.stack([self._ask(alone, place) for place in self.places])
        self.values = values - values.mean(axis=(0, 1, 2))
        self.effects = np.abs(self.values).max(axis=(1, 2)) * effect_mm(facts)

    def _places(self) -> list[float | None]:
        if len(self.inputs) < SLICES:
            return [None]
        low, high = ends(self.facts, self.inputs[2])
        return [float(low + share * (high - low)) for share in (1 / 6, 1 / 2, 5 / 6)]

    def _ask(self, alone: Field, place: float | None) -> Floats:
        """Corrections (G, G, 5 L), second input along the first axis."""
        values = [grid.ravel() for grid in np.meshgrid(*self.axes)]
        if place is not None:
            values.append(np.full(GRID * GRID, place))
        q = readings_at(self.facts, self.facts.typical, dict(zip(self.inputs, values, strict=False)))
        table = np.zeros_like(self.facts.calibration.arm.table)
        found = alone.parameters(np.ascontiguousarray(self.facts.inputs(q)), table)
        return np.asarray(found.reshape(GRID, GRID, -1))

    def moved(self) -> Figure:
        """Root of the sum of squares of what all parameters do to the judged point."""
        z = np.sqrt(np.square(self.values * effect_mm(self.facts)).sum(axis=-1))
        names = listed([f"{along.joint + 1}" for along in self.inputs])
        of = "D-H values of joints" if any(along.of_value for along in self.inputs) else "joints"
        return self._figure(
            f"Variation over {of} {names} together, all parameters",
            z,
            "mm",
            "Deviation of the parameters from their means over these slices, as it moves the measured point "
            f"(root sum of squares over the parameters): up to {fixed(float(z.max()))} mm, with a median of "
            f"{fixed(float(np.median(z)))} mm. The means are no part of it: the constants could take them."
            f"{self.besides}",
            {"zmin": 0, "zmax": float(f"{z.max():.4g}")},
        )

    def parameter(self, column: int) -> Figure:
        """One parameter, as it moves the judged point."""
        candidates = self.facts.calibration.arm.candidates
        name = candidates.names[candidates.columns.index(column)]
        z = self.values[..., column] * effect_mm(self.facts)[column]
        top = float(f"{np.abs(z).max():.4g}")
        return self._figure(
            f"{name} over the same slices",
            z,
            "mm",
            f"Deviation from the mean over the slices, as it moves the measured point: "
            f"{fixed(float(z.min()))} to {fixed(float(z.max()))} mm.",
            {"zmin": -top, "zmax": top, "colorscale": DIVERGING},
        )

    def _figure(self, title: str, z: Floats, bar: str, says: str, colours: dict[str, Any]) -> Figure:
        first, second = self.inputs[:2]
        shown = [self._shown(along, at) for along, at in zip((first, second), self.axes, strict=True)]
        traces = [
            heatmap(shown[0], shown[1], values, bar, visible=k == len(z) // 2, zsmooth="best") | colours
            for k, values in enumerate(z)
        ]
        return Figure(
            title,
            says,
            traces,
            {
                "xaxis": axis(self._label(first)),
                "yaxis": axis(self._label(second)),
            },
            height=330,
            choices=self._choices(len(z)),
        )

    def _choices(self, count: int) -> list[Choice]:
        if count == 1:
            return []
        third = self.inputs[2]
        labels = self._shown(third, np.array(self.places, dtype=np.float64))
        order = [1, 0, 2]
        return [
            Choice(
                f"{third.name} at {fixed(labels[k], 0)} {self.facts.unit(third.joint)}",
                [j == k for j in range(count)],
            )
            for k in order
        ]

    def _label(self, along: JointAxis) -> str:
        return f"{along.name}, {self.facts.unit(along.joint)}"

    def _shown(self, along: JointAxis, values: Floats) -> Floats:
        return self.facts.shown_of(along.joint, values)
