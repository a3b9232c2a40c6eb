"""experiment.md: the paper's experiment beside ours."""

from collections.abc import Mapping
from typing import Any, Final

from truearm.studies.markdown import table
from truearm.studies.panels import TITLES
from truearm.studies.process.judging import AGREES, arms_that_agree
from truearm.studies.process.setting import ANGLE_DEG, LENGTH_MM, SHARE

Result = Mapping[str, Any]

READINGS: Final = (
    (
        "Path and space",
        "Referred to an origin below the axis of joint 1: from the origin of Table I's world the end of the "
        "path is out of reach. The space is the box around the path, elbow up, joints 4 and 5 at zero.",
    ),
    (
        "Panel",
        "It looks at the robot along the table's y axis, so that the pin meets it by more than 15 deg with "
        "joints 4 and 5 at zero, at the end of the path too, where the forearm rises.",
    ),
    (
        "Errors",
        f"The fifteen parameters are off by {LENGTH_MM:g} mm and {ANGLE_DEG:g} deg, all positive, and the "
        f"first three joints err by themselves as in equation (6), {SHARE:g} times as much: sizes and seed "
        "for which Figure 10(a) comes out.",
    ),
    (
        "Division",
        "The longest side is halved, breadth first, until there are as many regions as above, whatever was "
        "measured: all poses are known beforehand and are measured in the paper's order in one session.",
    ),
    (
        "Measuring",
        "The process and drivers of `truearm measure` for the RV-M2 and the table, over pseudo-terminals: "
        "contacts at random for the frame, two contacts a pose, the controller's rounding to 0.1 deg, "
        "0.02 mm of the table, 0.05 mm of the panel and its counts. What the frame is off stays an error, "
        "as in the paper.",
    ),
    (
        "Errors on the path",
        "Of the real tool in the registered frame, where the controller is told the compensated position "
        "rounded to 0.1 mm. Ours is the variable model on the same rows with the base as a row of its own.",
    ),
)
HEAD: Final = ("scheme", "least mm", "mean mm", "max mm", "error jump mm", "CEP jump mm/mm", "unreached")


def page(result: Result) -> str:
    """The text of experiment.md."""
    session = result["session"]
    parts = [
        "# The paper's experiment, and ours",
        f"Made by `truearm study experiment`: {session['regions']:.0f} regions, "
        f"{session['measurements']:.0f} poses that identify them and {session['test_points']:.0f} that "
        f"judge, {session['contacts']:.0f} contacts in all, {session['skipped']:.0f} poses skipped; the "
        f"frame was registered to {session['registration_mm']:.2f} mm.",
        "## What the paper states, and what comes out",
        table(
            ("place", "the paper", "here", "agrees"),
            [(s["place"], s["paper"], s["ours"], AGREES[s["agrees"]]) for s in result["statements"]],
        ),
        "## Figure 10: the path",
        table(HEAD, [_on_path(name, part["path"]) for name, part in result["figure10"].items()]),
        "## The whole space, and other paths",
        "Position errors over 3000 poses of the space, as measured at the regions' test points (noise and "
        "rounding in them), and on ten straight paths between random points.",
        table(
            ("scheme", "space mean mm", "max mm", "test points mean mm", "max mm", "best path", "worst path"),
            [_elsewhere(name, part, result["paths"][name]) for name, part in result["figure10"].items()],
        ),
        "## Figures to reach",
        table(
            ("claim", "found", "to reach", "reached"),
            [
                (c["claim"], f"{c['value']['median']:.3g}", c["limit"], "yes" if c["reached"] else "no")
                for c in result["claims"]
            ],
        ),
        *_several(result.get("over_arms")),
        "## How it is read",
        table(("what", "reading"), READINGS),
    ]
    return "\n\n".join(parts) + "\n"


def _several(over: Result | None) -> list[str]:
    """What holds on several arms, where there are several."""
    if over is None:
        return []
    count = len(over["seeds"])
    return [
        f"## On {count} arms",
        f"With `--seeds {count}`: the same experiment on {count} virtual arms, the one above among them. "
        "Errors of the same sizes are drawn anew and all poses are measured anew. The first arm was taken "
        "because its path errs as that of Figure 10(a); the others come as they come.",
        table(
            ("place", "the paper", f"agrees on, of {count}"),
            [(s["place"], s["paper"], arms_that_agree(s)) for s in over["statements"]],
        ),
        "Medians over the arms, and the 95 % quantile in brackets, mm.",
        table(
            ("scheme", "path mean", "path max", "space mean", "space max", "worst of ten paths"),
            [_over_arms(name, part, over["paths"][name]) for name, part in over["figure10"].items()],
        ),
        table(
            ("claim", "median", "5 to 95 %", "to reach"),
            [(c["claim"], *_spread(c["value"]), c["limit"]) for c in over["claims"]],
        ),
    ]


def _over_arms(name: str, part: Result, paths: Result) -> tuple[str, ...]:
    path, space = part["path"], part["workspace"]
    numbers = (path["mean_mm"], path["max_mm"], space["mean_mm"], space["max_mm"], paths["worst_mean_mm"])
    return (_title(name), *(f"{x['median']:.3f} ({x['p95']:.3f})" for x in numbers))


def _spread(value: Result) -> tuple[str, str]:
    return f"{value['median']:.3g}", f"{value['p05']:.3g} to {value['p95']:.3g}"


def _on_path(name: str, path: Result) -> tuple[str, ...]:
    numbers = [path[key] for key in ("least_mm", "mean_mm", "max_mm")]
    jumps = [path[key] for key in ("jump_mm", "cep_jump")]
    shown = (*(f"{x:.2f}" for x in numbers), *(f"{x:.4f}" for x in jumps), f"{path['unreached']:.0f}")
    return (_title(name), *shown)


def _elsewhere(name: str, part: Result, paths: Result) -> tuple[str, ...]:
    space, tests = part["workspace"], part["tests"]
    worst = paths["worst_mean_mm"]
    numbers = (space["mean_mm"], space["max_mm"], tests["mean_mm"], tests["max_mm"])
    return (
        _title(name),
        *(f"{x:.3f}" for x in numbers),
        f"{worst / paths['worst_to_best']:.3f}",
        f"{worst:.3f}",
    )


def _title(name: str) -> str:
    return TITLES.get(name, name.replace("_", " "))
