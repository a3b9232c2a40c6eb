"""Chapter: the parameters of the model that predicts, and those of the constant one."""

from truearm.fits.models import CONSTANT
from truearm.reporting.facts import Facts
from truearm.reporting.parameters import confounding, table
from truearm.reporting.parts import Part, Section, Text
from truearm.reporting.varying_parameters import varying_parameters


def parameters(facts: Facts) -> Section:
    """What the poses determine, and the parameters of the models."""
    found = facts.calibration.identifiability
    poses = "poses" if facts.update is None else "poses of the calibration before the update"
    words = (
        f"The {poses} determine {found.rank} of {found.parameters} parameters of the arm, and with frames "
        f"and targets {found.total_rank} unknowns; the condition number is {found.condition:.0f}. The "
        "constants of the others are nominal."
    )
    parts: list[Part] = [Text(words)]
    parts += [] if facts.best == CONSTANT else [varying_parameters(facts)]
    figure = confounding(facts)
    return Section("Parameters", [*parts, table(facts), *([figure] if figure is not None else [])])
