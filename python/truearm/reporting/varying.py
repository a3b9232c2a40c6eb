"""Chapter: how the parameters vary."""

import json
from collections.abc import Sequence
from typing import Any, Final

from truearm.fits.models import CONSTANT, VARIABLE
from truearm.reporting.axes import coupling_words
from truearm.reporting.curves import along, influence
from truearm.reporting.facts import Facts
from truearm.reporting.gravity import sag
from truearm.reporting.numbers import fixed, listed
from truearm.reporting.parts import Part, Section, Table, Text
from truearm.reporting.region_tree import region_tree
from truearm.reporting.slices import slices
from truearm.reporting.sweeps import influence_mm, swept_names
from truearm.storage.summary import WAVE, waves_in_words
from truearm.types import Floats

Block = dict[str, Any]

ROUNDING_MM: Final = 1e-9
"""An effect that is smaller is none but rounding."""


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
    flat = without_effect(facts, effects)
    if flat:
        names = [name for k, name in enumerate(swept_names(facts)) if k in flat]
        where = "any joint" if len(flat) == len(effects) else listed(names, last="or")
        words += f" The {facts.best} model does not vary along {where}."
    parts: list[Part] = [Text(words, is_note=True)]
    parts += [influence(facts, effects)] if len(flat) < len(effects) else []
    tree = region_tree(facts)
    parts += [tree] if tree is not None else []
    parts += [along(facts, which, effects[which]) for which in range(len(effects)) if which not in flat]
    parts += slices(facts)
    weight = sag(facts)
    parts += [weight] if weight is not None else []
    blocks = facts.summary["blocks"]
    parts += [_blocks(facts)] if blocks else []
    return Section(title, parts)


def without_effect(facts: Facts, effects: Floats) -> list[int]:
    """Inputs along which a scheme does not vary, as joints that it does not divide; effects (I, 5 L), mm."""
    if facts.calibration.scheme is None:
        return []
    return [k for k, moved in enumerate(effects) if moved.max() < ROUNDING_MM]


def _blocks(facts: Facts) -> Table:
    """The blocks of the field as summary.json has them; those that differ in their joint alone in one row."""
    blocks = facts.summary["blocks"]
    shown = [key for key in _AMPLITUDES if any(key in block["amplitudes"] for block in blocks)]
    rows = []
    for alike in _alike(blocks):
        amplitudes, cells = alike[0]["amplitudes"], sorted({block["cells"] for block in alike})
        rows.append(
            [
                alike[0]["name"],
                _over(alike),
                str(alike[0]["parameters"]),
                " to ".join(str(count) for count in dict.fromkeys((cells[0], cells[-1]))),
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


def _alike(blocks: Sequence[Block]) -> list[list[Block]]:
    """Blocks over one joint each that are alike but for it, together; every other by itself."""
    groups: dict[str, list[Block]] = {}
    for number, block in enumerate(blocks):
        alone = len(block["joints"]) == 1 and not block["features"] and block["name"] != WAVE
        kept = {name: value for name, value in block.items() if name not in ("joints", "lengths", "cells")}
        groups.setdefault(json.dumps(kept) if alone else str(number), []).append(block)
    return list(groups.values())


def _over(alike: Sequence[Block]) -> str:
    """What blocks that are alike are over."""
    block = alike[0]
    kind = "reading" if block.get("over_reading") else "joint"
    if len(alike) > 1:
        joints = [str(joint) for each in alike for joint in each["joints"]]
        inputs = [f"each of {kind}s {', '.join(joints)}"]
    else:
        inputs = [f"{kind} {joint}" for joint in block["joints"]] + list(block["features"])
    if block["name"] == WAVE:
        inputs.append(waves_in_words([block]))
    if "ripples" in block:
        inputs.append(f"may ripple about {block['ripples']:.0f} times a turn")
    return ", ".join(inputs)


_COLUMNS: Final = ("block", "over", "parameters", "cells")
_AMPLITUDES: Final = {
    "theta_mrad": "theta, mrad",
    "theta_mrad_per_m": "theta, mrad for a lever of 1 m",
    "other_angles_mrad": "other angles, mrad",
    "lengths_mm": "lengths, mm",
}
