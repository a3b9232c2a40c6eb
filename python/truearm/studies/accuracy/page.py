"""The page of the study: who is first where, all means, what each block adds, and what it costs."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import median
from typing import Any, Final

from truearm.studies.accuracy.methods import FAMILIES, OURS, TITLES
from truearm.studies.accuracy.methods.ours import FURTHER_BLOCKS, PARTS
from truearm.studies.accuracy.splits import TITLES as SPLITS
from truearm.studies.accuracy.summary import LEVEL
from truearm.studies.markdown import table

Summary = Mapping[str, Any]

DETAILED: Final = ("400", "all", "200", "100", "50", "25")
"""The first of these sizes that there is, is told in detail."""
HALF: Final = 0.5
SEVERAL_A_SEED: Final = ("tails", "target")
CUMULATED: Final = (
    {"constant": "constant"}
    | {part: f"+ {block}" for part, block in PARTS.items()}
    | {OURS: f"+ {FURTHER_BLOCKS[-1]}: ours"}
)
"""Heads of the columns of what blocks add, by the methods that have them."""
ABOUT: Final = (
    "Mean held-out position error in mm, the median over runs: one run is a seed and, for tails, one joint's "
    "tail. Each table has its number of runs and seeds, and the least number of held-out rows of a run. In "
    "bold the lowest mean and those within 3 % of it; a method that could not be fitted to all runs has how "
    "many in brackets, and takes no part in that."
)


def page(summary: Summary) -> str:
    """The text of accuracy.md."""
    asked, failed = summary["asked"], summary["failed"]
    missing = asked - summary["there"] - failed
    parts = [
        "# Comparison of methods",
        f"Made by `truearm study accuracy`, version {summary['version']}. {ABOUT}",
        _versions(summary),
        f"{missing} of {asked} results are not there yet." if missing else "",
        f"{failed} of {asked} results could not be found: the last table says why." if failed else "",
        *sections(summary),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def sections(summary: Summary) -> list[str]:
    """Everything below the title: standing, means, blocks, cost, failures."""
    return [
        "## Where ours stands",
        _standing(summary),
        _standing_without_curves(summary),
        *_means(summary),
        *_blocks(summary),
        *_cost(summary),
        *_failures(summary),
    ]


def _versions(summary: Summary) -> str:
    """A sentence on the versions that results are of, where they are of another than the page."""
    found = summary["versions"]
    if set(found) <= {summary["version"]}:
        return ""
    each = ", ".join(f"{name} ({count})" for name, count in sorted(found.items()))
    return f"Versions that found the results: {each}; `--again` finds those of a method anew."


def _standing(summary: Summary) -> str:
    words = (
        "Ours, and its ratio to the best other method, which is named: below one ours is better. "
        "In bold where it is first or within 3 %. They are compared over the runs that both could be fitted "
        "to, which are counted where they are not all."
    )
    return f"{words}\n\n{_lead_table(summary, _lead_cell)}"


def _standing_without_curves(summary: Summary) -> str:
    words = "Its ratio to the best of those that have no curves of single joints; in bold below a half."
    return f"{words}\n\n{_lead_table(summary, _plain_cell)}"


def _lead_table(summary: Summary, cell: Callable[[Mapping[str, Any]], str]) -> str:
    """One cell for each set, split and size where ours can be compared."""
    rows = []
    for (name, split), groups in _by_set_and_split(summary).items():
        led = [groups.get(size, {}) for size in summary["sizes"]]
        rows.append((name, SPLITS[split], *(cell(group) if group.get("lead") else "" for group in led)))
    return table(("set", "split", *summary["sizes"]), rows)


def _lead_cell(group: Mapping[str, Any]) -> str:
    lead, number = group["lead"], f"{group['lead']['ours_mm']:.3f}"
    ratio = f"{lead['ratio']:.2f} {lead['best']}{_of_runs(lead['runs'], group['runs'], ', ')}"
    return f"**{number}** ({ratio})" if lead["level"] else f"{number} ({ratio})"


def _plain_cell(group: Mapping[str, Any]) -> str:
    ratio, best = group["lead"]["ratio_without_curves"], group["lead"]["best_without_curves"]
    best += _of_runs(group["lead"]["runs_without_curves"], group["runs"], ", ")
    return f"**{ratio:.2f}** {best}" if ratio < HALF else f"{ratio:.2f} {best}"


def _of_runs(runs: int, of: int, before: str = "") -> str:
    """How many runs a number is of, in words; nothing where it is of all."""
    return "" if runs == of else f"{before}{runs} of {of}"


def _means(summary: Summary) -> Iterable[str]:
    name_before = ""
    for (name, split), groups in _by_set_and_split(summary).items():
        if name != name_before:
            about = summary["sets"][name]
            yield f"## {name}"
            yield f"{about['robot']}, {about['rows']} rows."
            name_before = name
        yield f"### {name}: {SPLITS[split]}"
        yield _means_table(groups, summary["sizes"])


def _means_table(groups: Mapping[str, Mapping[str, Any]], sizes: Sequence[str]) -> str:
    there = [size for size in sizes if size in groups]
    detailed = next(size for size in DETAILED + tuple(there) if size in groups)
    shown = [name for name in TITLES if FAMILIES[name] != "block"]
    lowest = {size: min(_whole_mean(groups[size], name) for name in shown) for size in there}
    rows = []
    for name in shown:
        if not any(name in groups[size]["methods"] for size in there):
            continue
        means = [_mean_cell(groups[size], name, lowest[size]) for size in there]
        rows.append((TITLES[name], *means, *_details(groups[detailed]["methods"].get(name, {}))))
    told = [f"{size}: {_count(groups[size])}" for size in there]
    head = ("method", *there, "worst", "95 %", "99 %", "max", "covered")
    held = [f"{size}: {groups[size]['n_holdout']}" for size in there if groups[size]["n_holdout"]]
    words = (
        f"Runs: {'; '.join(told)}. Held-out rows: {'; '.join(held)}. "
        f"The last five columns are of {detailed} poses."
    )
    return f"{words}\n\n{table(head, rows)}"


def _count(group: Mapping[str, Any]) -> str:
    seeds = f"{group['seeds']} seed{'s' if group['seeds'] > 1 else ''}"
    return f"{group['runs']} runs of {seeds}" if group["split"] in SEVERAL_A_SEED else seeds


def _number(value: float | None, digits: int = 3) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _whole_mean(group: Mapping[str, Any], name: str) -> float:
    """A method's mean where it could be fitted to all runs; infinite otherwise."""
    found = group["methods"].get(name, {})
    return float(found["mean_mm"]) if found.get("runs") == group["runs"] else float("inf")


def _mean_cell(group: Mapping[str, Any], name: str, lowest: float | None = None) -> str:
    """A mean with how many runs it is of, where these are not all; in bold up to 3 % above the lowest."""
    found = group["methods"].get(name, {})
    if "mean_mm" not in found:
        return ""
    number, some = f"{found['mean_mm']:.3f}", _of_runs(found["runs"], group["runs"])
    if some:
        return f"{number} ({some})"
    return f"**{number}**" if lowest is not None and found["mean_mm"] <= LEVEL * lowest else number


def _details(found: Mapping[str, Any]) -> tuple[str, ...]:
    if "mean_mm" not in found:
        return ("",) * 5
    numbers = [f"{found[key]:.3f}" for key in ("worst_mean_mm", "p95_mm", "p99_mm", "max_mm")]
    covered = found["coverage_95"]
    return (*numbers, "" if covered is None else f"{100 * covered:.0f} %")


def _blocks(summary: Summary) -> Iterable[str]:
    rows = []
    for (name, split), groups in _by_set_and_split(summary).items():
        size = next(size for size in DETAILED + tuple(groups) if size in groups)
        found = groups[size]["methods"]
        if not PARTS.keys().isdisjoint(found):
            means = [_mean_cell(groups[size], name) for name in CUMULATED]
            rows.append((name, SPLITS[split], size, str(groups[size]["runs"]), *means))
    if rows:
        yield "## What each block adds"
        yield (
            "Blocks are added one after the other, from left to right. Scales are those that the whole model "
            "found; the blocks further right are switched off, and everything else is fitted again. Where "
            "those do most of the work, a column further left takes over what is theirs, and may be worse "
            "than none. A block that the evidence did not ask for changes nothing."
        )
        yield table(("set", "split", "poses", "runs", *CUMULATED.values()), rows)


def _cost(summary: Summary) -> Iterable[str]:
    sizes = [size for size in summary["sizes"] if any(g["size"] == size for g in summary["groups"])]
    rows = []
    for name in TITLES:
        fits = [_over_groups(summary, name, size, "fit_s") for size in sizes]
        predicts = [_over_groups(summary, name, size, "predict_us") for size in sizes]
        known = [value for value in predicts if value is not None]
        if known:
            rows.append((TITLES[name], *(_number(value, 2) for value in fits), f"{max(known):.1f}"))
    if rows:
        yield "## What it costs"
        yield (
            "Seconds of one thread to fit, search of settings included, the median over all sets and splits; "
            "and microseconds a pose to predict many at once, of the size where it is most."
        )
        yield table(("method", *(f"{size}, s" for size in sizes), "predict, us"), rows)


def _over_groups(summary: Summary, name: str, size: str, key: str) -> float | None:
    values = [
        group["methods"][name][key]
        for group in summary["groups"]
        if group["size"] == size and group["methods"].get(name, {}).get(key) is not None
    ]
    return median(values) if values else None


def _failures(summary: Summary) -> Iterable[str]:
    failed: dict[tuple[str, str], int] = {}
    for record in summary["results"]:
        if "failed" in record:
            key = (record["method"], _without_folders(record["failed"], record["set"]))
            failed[key] = failed.get(key, 0) + 1
    if failed:
        yield "## Could not be fitted"
        yield table(
            ("method", "results", "why"),
            [(TITLES[name], str(count), why) for (name, why), count in failed.items()],
        )


def _without_folders(why: str, name: str) -> str:
    """A message without the folders of the set's file: where a reader has it is another matter."""
    return re.sub(rf"\S*[/\\](?={re.escape(name)}\.)", "", why)


def _by_set_and_split(summary: Summary) -> dict[tuple[str, str], dict[str, Mapping[str, Any]]]:
    """Groups by size, of each set and split."""
    found: dict[tuple[str, str], dict[str, Mapping[str, Any]]] = {}
    for group in summary["groups"]:
        found.setdefault((group["set"], group["split"]), {})[group["size"]] = group
    return found
