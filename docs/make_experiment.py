"""Write docs/explanations/the-papers-experiment.md, with its figure, from an experiment.

truearm study experiment -o EXPERIMENT --seeds 10
python docs/make_experiment.py EXPERIMENT
"""

import argparse
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "explanations" / "the-papers-experiment.md"
FIGURE = "figure10.svg"
HEAD = """# The paper's experiment

Section 7 of the paper measures a Mitsubishi RV-M2 with an x-y-z table and a touch panel, divides the space
into 85 regions, and follows a path with each calibration. `truearm study experiment` repeats that on a
virtual cell, through the [measurement process](../how-to/measure-automatically.md), drivers and
[protocols](../reference/cell-protocols.md) that real devices have: what is virtual begins behind the wires.
This page is written by `docs/make_experiment.py` from what the command gave; the simulations of section 6
have [a page of their own](comparison-with-the-paper.md).
"""
SHOWN = f"""
![Position errors and CEPs along the path of Figure 10]({FIGURE})

Left: errors of the tool on the path, without calibration and compensated by each scheme. Right: CEPs of link
1 along it. Mind the scales.
"""


def main() -> int:
    """Write the page and its figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("experiment", type=Path, help="directory that truearm study experiment wrote")
    given = parser.parse_args()
    body = re.sub(r"^# .*\n", "", (given.experiment / "experiment.md").read_text())
    before, heading, after = body.partition("## Figure 10: the path\n")
    PAGE.write_text("".join((HEAD, before.rstrip("\n"), "\n\n", heading, SHOWN, after)))
    (PAGE.parent / FIGURE).write_bytes((given.experiment / FIGURE).read_bytes())
    sys.stdout.write(f"written to {PAGE}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
