"""Write docs/explanations/comparison-with-the-paper.md from a study of the paper and schemes on real data.

truearm study paper -o STUDY
python -m benches.schemes SCHEMES
python docs/make_comparison.py STUDY SCHEMES
"""

import argparse
import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "explanations" / "comparison-with-the-paper.md"
ARMS = {"irb120": "IRB 120, 400 training poses", "ur10c": "UR10 set-up C, 400 training poses"}
SCHEMES = {
    "regions": "regions, CEPs shrunk towards the parent",
    "regions-least-squares": "regions, least squares",
    "fcmac": "FCMAC on shrunk CEPs",
    "fcmac-least-squares": "FCMAC on least-squares CEPs",
    "cmac": "CMAC on shrunk CEPs",
    "fcmac-measurements": "B-spline FCMAC on measurements, joints 1, 2, 3",
    "fcmac-measurements-234": "the same, joints 2, 3, 4",
}
HEAD = """# Comparison with the paper

truearm began with a paper that proposes D-H parameters which vary over the workspace, held in an FCMAC:
"Implementation of a Variable D-H Parameter Model for Robot Calibration Using an FCMAC Learning
Algorithm". Its scheme is here whole: `truearm calibrate --model regions|cmac|fcmac` beside the default,
and its simulations in `truearm study paper` ([how to run them](../tutorials/reproduce-the-paper.md), [how
its open points are read](../decisions/0011-readings-of-the-paper.md)). This page is written by
`docs/make_comparison.py` from what those commands gave.

## What to keep of it

- The idea holds: parameters that vary leave a fraction of what constants leave, and the error does not
  break at borders.
- Least squares in a small region is badly conditioned. Without noise that does no harm; with noise such
  CEPs are worse than few good ones, and a network that interpolates them adds its own error. Shrunk towards
  the parent region they keep what the measurements tell and leave the rest alone.
- Keeping the c sensors with the largest grades lets the output jump where the set changes, the more the
  wider the sensors. Half a cell keeps it small; B-splines have exactly c cells and do not jump.
- Fitting weights to the measurements, not to regional CEPs, is what makes the difference with noise. The
  default model does that with a prior whose scales come from the data ([why](why-measurement-space.md)).
"""
REAL = """## Real arms

Passive mode on public measurements: mean / RMS / max position error in mm on held-out rows, seed 7, and
the mean in parts of the repeatability that the maker states (0.01 mm IRB 120, 0.1 mm UR10), which is the
accuracy that the paper aims at. All models are fitted to the same rows and judged on the same rows.
"""
REASON = """
A region needs twenty rows, so that 400 poses give about ten regions, each a good part of a turn wide:
what varies within one stays. Part of what the IRB 120 does wrong varies that slowly with its first three
joints, and regions gain there; the UR10 errs with single joints at a scale of a few degrees, which
neither regions nor cells this wide can hold. Weights fitted to the measurements use the same cells
better, as every row speaks for all cells that it excites. Least squares serves only with parameters that
all rows together determine well; others are left at the constants, or regions of poses that hardly tell
them would shift by metres. The variable model has blocks for single joints, and that is its lead.
"""


def main() -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", type=Path, help="directory that truearm study paper wrote")
    parser.add_argument("schemes", type=Path, help="directory that benches.schemes wrote")
    given = parser.parse_args()
    study = (given.study / "paper.md").read_text()
    body = re.sub(r"^# .*\n", "", study)
    parts = [
        HEAD,
        REAL,
        *(real_table(given.schemes, arm) for arm in ARMS),
        REASON,
        "## Simulations\n",
        demoted(body),
    ]
    PAGE.write_text("\n".join(part.strip("\n") + "\n" for part in parts))
    sys.stdout.write(f"written to {PAGE}\n")
    return 0


def real_table(schemes: Path, arm: str) -> str:
    """One arm: nominal, constant, the schemes, variable."""
    variable = json.loads((schemes / f"{arm}-variable.json").read_text())
    rows = [row(name, variable, name) for name in ("nominal", "constant")]
    for scheme, title in SCHEMES.items():
        found = json.loads((schemes / f"{arm}-{scheme}.json").read_text())
        rows.append(row(title, found, found["options"]["model"]))
    rows.append(row("variable model, `--drift none`", variable, "variable"))
    head = f"| {ARMS[arm]} | mean / RMS / max | of repeatability | regions |\n|---|---|---|---|"
    return "\n".join([head, *rows])


def row(title: str, found: dict, model: str) -> str:
    """A model's errors on held-out rows."""
    errors, ratio = found["holdout"][model], found["error_to_repeatability"][model]
    numbers = " / ".join(f"{errors[key]:.3f}" for key in ("mean_mm", "rms_mm", "max_mm"))
    regions = found["scheme"]["regions"] if found["scheme"] and found["scheme"]["regions"] else ""
    return f"| {title} | {numbers} | {ratio:.1f} | {regions} |"


def demoted(text: str) -> str:
    """Headings one level down."""
    return re.sub(r"^#", "##", text, flags=re.MULTILINE)


if __name__ == "__main__":
    sys.exit(main())
