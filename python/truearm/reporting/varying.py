"""Chapter: how the parameters vary."""

from typing import Final

from truearm.models import CONSTANT, VARIABLE
from truearm.reporting.axes import coupling_words
from truearm.reporting.curves import along, influence
from truearm.reporting.facts import Facts
from truearm.reporting.gravity import sag
from truearm.reporting.numbers import fixed
from truearm.reporting.parts import Part, Section, Table, Text
from truearm.reporting.region_tree import region_tree
from truearm.reporting.slices import slices
from truearm.reporting.sweeps import influence_mm
from truearm.summary import WAVE, waves_in_words


def varying(facts: Facts) -> Section:
    """Curves, slices, regions, and what varies with the levers of the links."""
    title = "How the parameters vary"
    if facts.best == CONSTANT:
        return Section(title, [Text("The parameters of this calibration are constant.")])
    effects = influence_mm(facts)
    swept = "joint or feature" if facts.features else "joint"
    words = (
        f"Curves show the deviation of a parameter from its mean along the {swept}; the other joints stay in "
        f"a typical pose.{coupling_words(facts)}{facts.at_features}"
    )
    if facts.best == VARIABLE and facts.readings is not None:
        words += " Bands are two standard deviations of that deviation to either side."
    parts: list[Part] = [Text(words, is_note=True), influence(facts, effects)]
    tree = region_tree(facts)
    parts += [tree] if tree is not None else []
    parts += [along(facts, which, effects[which]) for which in range(len(effects))]
    parts += slices(facts)
    weight = sag(facts)
    parts += [weight] if weight is not None else []
    blocks = facts.summary["blocks"]
    parts += [_blocks(facts)] if blocks else []
    return Section(title, parts)


def _blocks(facts: Facts) -> Table:
    """The blocks of the field as summary.json has them."""
    rows, blocks = [], facts.summary["blocks"]
    shown = [key for key in _AMPLITUDES if any(key in block["amplitudes"] for block in blocks)]
    for block in blocks:
        amplitudes = block["amplitudes"]
        kind = "reading" if block.get("over_reading") else "joint"
        inputs = [f"{kind} {joint}" for joint in block["joints"]] + list(block["features"])
        if block["name"] == WAVE:
            inputs.append(waves_in_words([block]))
        if "ripples" in block:
            inputs.append(f"may ripple about {block['ripples']:.0f} times a turn")
        rows.append(
            [
                block["name"],
                ", ".join(inputs),
                str(block["parameters"]),
                str(block["cells"]),
                *(fixed(amplitudes[key]) if key in amplitudes else "" for key in shown),
            ]
        )
    return Table(
        "Blocks of the field",
        [*_COLUMNS, *(_AMPLITUDES[key] for key in shown)],
        rows,
        says="The last columns are the standard deviations of the prior, chosen by the evidence: how far "
        "each block may take its parameters.",
        left=(0, 1),
    )


_COLUMNS: Final = ("block", "over", "parameters", "cells")
_AMPLITUDES: Final = {
    "theta_mrad": "theta, mrad",
    "theta_mrad_per_m": "theta, mrad for a lever of 1 m",
    "other_angles_mrad": "other angles, mrad",
    "lengths_mm": "lengths, mm",
}
