"""Chapter: how the parameters vary."""

from truearm.models import CONSTANT, VARIABLE
from truearm.reporting.curves import along, influence
from truearm.reporting.facts import Facts
from truearm.reporting.gravity import sag
from truearm.reporting.numbers import fixed
from truearm.reporting.parts import Part, Section, Table, Text
from truearm.reporting.region_tree import region_tree
from truearm.reporting.slices import slices
from truearm.reporting.sweeps import influence_mm


def varying(facts: Facts) -> Section:
    """Curves, slices, regions, and what varies with weight."""
    title = "How the parameters vary"
    if facts.best == CONSTANT:
        return Section(title, [Text("This calibration holds all parameters constant.")])
    effects = influence_mm(facts)
    words = "Curves show how a parameter differs from its mean along the joint, other joints in a usual pose."
    if facts.best == VARIABLE and facts.readings is not None:
        words += " Bands are two standard deviations of that difference on either side."
    parts: list[Part] = [Text(words, is_note=True), influence(facts, effects)]
    tree = region_tree(facts)
    parts += [tree] if tree is not None else []
    parts += [along(facts, joint, effects[joint]) for joint in range(len(facts.joints))]
    parts += slices(facts)
    weight = sag(facts)
    parts += [weight] if weight is not None else []
    blocks = facts.summary["blocks"]
    parts += [_blocks(facts)] if blocks else []
    return Section(title, parts)


def _blocks(facts: Facts) -> Table:
    """The blocks of the field as summary.json has them."""
    rows = []
    for block in facts.summary["blocks"]:
        amplitudes = block["amplitudes"]
        inputs = [f"joint {joint}" for joint in block["joints"]] + list(block["features"])
        rows.append(
            [
                block["name"],
                ", ".join(inputs),
                str(block["parameters"]),
                str(block["cells"]),
                *(fixed(amplitudes[key]) if key in amplitudes else "" for key in _AMPLITUDES),
            ]
        )
    return Table(
        "Blocks of the field",
        ["block", "over", "parameters", "cells", "theta, mrad", "other angles, mrad", "lengths, mm"],
        rows,
        says="Amplitudes are standard deviations of the prior that the evidence chose: how much each block "
        "is allowed.",
        left=(0, 1),
    )


_AMPLITUDES = ("theta_mrad", "other_angles_mrad", "lengths_mm")
