"""paper.md: what the paper states beside what comes out, and the readings chosen."""

from collections.abc import Mapping
from typing import Any, Final

from truearm.studies.markdown import table

Result = Mapping[str, Any]

READINGS: Final = (
    (
        "Table I",
        "A = Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta) for all rows; it gives the paper's 15 of 25 "
        "parameters.",
    ),
    (
        "Equation (4)",
        "As printed it is a norm times the inverse of the same norm. Taken as the condition number of"
        " M^t M, the square of that of M; numbers here are of M, rows in mm, columns per mm and per "
        "1/300 rad.",
    ),
    (
        "Errors",
        "0.4 mm and 0.05 deg, all positive: only so the path's errors are those of Figure 6(a). "
        "Random signs are run too.",
    ),
    (
        "Equation (6)",
        "Cartesian errors in the base frame, linear in cosines and sines of the first three joints, 9"
        " % of the mean geometric error; joint errors are run too.",
    ),
    (
        "Error after compensation",
        "Real point minus predicted point at the corrected joints, which is what compensation leaves "
        "at the pose that was asked for.",
    ),
    (
        "Division",
        "Halving of the longest side, measured in parts of the whole space, breadth first. 20 poses a"
        " node chosen from candidates by the condition number, 10 test points. Once it stops by "
        "itself at 0.1 mm, once it is forced to the paper's number of regions.",
    ),
    (
        "Measurements",
        "All schemes are given the rows of the leaves. Parents and test points are counted beside them.",
    ),
    (
        "Figure 4(c)",
        "Its ranges are swapped: azimuth +-150 deg, elevation +-45 deg. The origin is on joint 1's "
        "axis at the shoulder's height, from where the arm reaches the 805 mm of the figure.",
    ),
    (
        "FCMAC",
        "17 x 11 x 11 cells over theta 1, 2, 3 (11 x 17 x 11 over R, theta, phi), c = 3, min "
        "composition, sigma half a cell, 27 points of each region, weights start at the mean CEPs; "
        "(A5) as printed with a rate of 0.5.",
    ),
    (
        "Region without data",
        "The region in the middle of the path; the scheme without FCMAC takes the mean of the regions"
        " that share a face with it.",
    ),
    (
        "CEP jump",
        "Largest change of any of the parameters between neighbouring points of 200, for each mm of path "
        "between them, angles at 300 mm.",
    ),
)
TABLES: Final = ("figure6", "noise", "figure7", "figure8", "paths", "cmac")
TITLES: Final[Mapping[str, str]] = {
    "figure6": "Figure 6: joint space, no noise",
    "noise": "The same with 3 % of noise",
    "figure7": "Figure 7: spherical space, no noise",
    "figure8": "Figure 8: one region without data",
    "paths": "Ten random paths",
    "cmac": "CMAC against FCMAC",
}


def page(result: Result) -> str:
    """The text of paper.md; numbers are medians over the seeds."""
    seeds = result["seeds"]
    parts = [
        "# The paper's simulations, and ours",
        f"Made by `truearm study paper` over {len(seeds)} seeds; numbers are medians.",
        "## What the paper states, and what comes out",
        table(
            ("place", "the paper", "here", "agrees"),
            [
                (s["place"], s["paper"], s["ours"], "yes" if s["agrees"] else "no")
                for s in result["statements"]
            ],
        ),
        "## Readings chosen",
        table(("where", "reading"), READINGS),
        "## Figures to reach",
        table(
            ("claim", "median", "5 %", "95 %", "to reach", "reached"),
            [_claim(entry) for entry in result["claims"]],
        ),
    ]
    for name in TABLES:
        if name in result:
            parts += [f"## {TITLES[name]}", _schemes(result[name])]
    if "readings" in result:
        parts += ["## Other readings of the errors", _readings(result["readings"])]
    if "cmac" in result:
        parts += ["## What the network's open values change", _schemes(result["cmac"]["sensitivity"])]
    return "\n\n".join(parts) + "\n"


def _claim(entry: Mapping[str, Any]) -> tuple[str, ...]:
    value = entry["value"]
    reached = {True: "yes", False: "no", None: ""}[entry["reached"]]
    numbers = tuple(f"{value[key]:.3g}" for key in ("median", "p05", "p95"))
    return (entry["claim"], *numbers, entry["limit"], reached)


def _schemes(found: Result) -> str:
    """One row for each scheme."""
    rows = []
    for name, part in found.items():
        if "path" not in part:
            continue
        path = part["path"]
        pieces = {f" {where}": path[where] for where in ("inside", "rest") if where in path} or {"": path}
        for where, piece in pieces.items():
            rows.append((f"{name}{where}", *_numbers(piece), *_workspace(part)))
    on_path = ("path mean mm", "max mm", "error jump mm", "CEP jump mm/mm")
    head = ("scheme", *on_path, "workspace mean mm", "max mm")
    return table(head, rows)


def _numbers(piece: Result) -> tuple[str, ...]:
    return tuple(f"{piece[key]['median']:.4f}" for key in ("mean_mm", "max_mm", "jump_mm", "cep_jump"))


def _workspace(part: Result) -> tuple[str, ...]:
    if "workspace" not in part:
        return ("", "")
    return tuple(f"{part['workspace'][key]['median']:.4f}" for key in ("mean_mm", "max_mm"))


def _readings(found: Result) -> str:
    rows = []
    for name, part in found.items():
        for noise in ("clean", "noise"):
            for scheme, judged in part[noise].items():
                rows.append((name, noise, scheme, *_numbers(judged["path"])[:2], *_workspace(judged)))
    head = ("reading", "noise", "scheme", "path mean mm", "max mm", "workspace mean mm", "max mm")
    return table(head, rows)
