"""Write docs/reference/updating.md from what `python -m benches.updating OUT` left.

python docs/make_updating.py OUT
"""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import fmean, median
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "updating.md"
ARMS = {"rv-m2": "RV-M2", "ur10": "UR10"}
HEAD = """# Updates and proposed poses, measured

`python -m benches.updating OUT` measures this, and `python docs/make_updating.py OUT` writes this page.
Virtual arms are the paper's: geometric errors of 0.4 mm and 0.05 deg, a field of a tenth of their
effect, and 0.04 mm of noise in each measured coordinate. Errors are mean position errors at fresh poses,
without noise, in the calibration's own set-up; a row of a table is over several arms, drawn from
different seeds. See [check and update](../how-to/check-and-update-a-calibration.md) and [choose
poses](../how-to/choose-poses.md).
"""
UPDATE = """## After re-mastering

Two to four joints move by 0.1 to 1 deg and the tool by 1 mm; 15 random poses are measured, with the
device's frame found anew. "Told" offsets are those of all joints but the first and the last, which a
free frame and a free tool hide.
"""
UNCHANGED = """## An arm that did not change

15 random poses of an unchanged arm. `truearm update` should say that the calibration holds in all but
the stated share.
"""
ACCEPTANCE = """## Acceptance poses

One joint of those that can be told moves by 0.03 deg. Ten poses of `plan --acceptance` and ten random
ones of the same candidates; "noticed" is every verdict but "holds", at the level of 1 %.
"""
NEXT = """## The next twenty poses

A calibration from 40 (RV-M2) or 60 (UR10) random poses, and 20 more: those of `plan --next`, or random
ones of the same 300 candidates (three draws an arm). All rows are fitted anew, hyper-parameters and all.
"""
REAL = """## A real arm in another set-up

A UR10's calibration from 400 poses of one set-up and 15 poses of another one, hours or days later,
positions only (christianlandgraf/ipa-robot-accuracy). The target is another one (`--new-tool`). Errors,
with noise, at the other poses, frame and target found from 200 of them.
"""


def main() -> int:
    """Read the results and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="directory that benches.updating wrote")
    out = parser.parse_args().out
    parts = [HEAD, UPDATE, update_table(out), "", UNCHANGED, unchanged_table(out), "", ACCEPTANCE]
    parts += [acceptance_table(out), "", NEXT, next_table(out), ""]
    found = sorted(out.glob("real-*.json"))
    if found:
        parts += [REAL, real_table(found), ""]
    PAGE.write_text("\n".join(parts))
    sys.stdout.write(f"written to {PAGE}\n")
    return 0


def read(out: Path, case: str, arm: str) -> list[dict[str, Any]]:
    """The results of a case and an arm, by seed."""
    return [json.loads(path.read_text()) for path in sorted(out.glob(f"{case}-{arm}-*.json"))]


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def update_table(out: Path) -> str:
    """Errors before and after, verdicts, and how far offsets are off in standard errors."""
    rows = []
    for arm, title in ARMS.items():
        found = read(out, "updates", arm)
        moved = [entry for each in found for entry in each["moved"]]
        if not moved:
            continue
        ratios = [abs(ratio) for entry in moved for ratio in entry["ratios"]]
        rows.append(
            [
                title,
                f"{len(found)}, {len(moved)}",
                f"{fmean(each['own_mm'] for each in found):.3f}",
                f"{fmean(entry['old_mm'] for entry in moved):.2f}",
                f"{fmean(entry['updated_mm'] for entry in moved):.3f}",
                f"{max(entry['updated_mm'] for entry in moved):.3f}",
                f"{sum(entry['verdict'] == 'moved' for entry in moved)}",
                f"{sum(ratio < 2.0 for ratio in ratios)} of {len(ratios)}",
            ]
        )
    columns = (
        "arm", "arms, re-masterings", "calibration on its own arm, mm", "old one afterwards, mm",
        "updated, mm", "worst updated, mm", 'said "moved"', "told offsets within 2 standard errors",
    )  # fmt: skip
    return table(columns, rows)


def unchanged_table(out: Path) -> str:
    """Share of verdicts other than "holds" at two levels."""
    rows = []
    for arm, title in ARMS.items():
        found = read(out, "unchanged", arm)
        pairs = [pair for each in found for pair in each["p"]]
        if not pairs:
            continue
        wrong = [sum(min(pair) < level / 2.0 for pair in pairs) for level in (0.01, 0.05, 0.2)]
        rows.append([title, f"{len(found)}, {len(pairs)}", *(f"{share / len(pairs):.1%}" for share in wrong)])
    return table(("arm", "arms, updates", "not held at 1 %", "at 5 %", "at 20 %"), rows)


def acceptance_table(out: Path) -> str:
    """Share of small changes that were noticed, and standard errors of the offset."""
    rows = []
    for arm, title in ARMS.items():
        found = read(out, "acceptance", arm)
        for kind in ("chosen", "random") if found else ():
            entries = [entry for each in found for entry in each[kind]]
            noticed = sum(entry[0] for entry in entries) / len(entries)
            error = median(entry[1] for entry in entries if entry[1] is not None)
            words = "acceptance" if kind == "chosen" else "random"
            rows.append([title, words, str(len(entries)), f"{noticed:.0%}", f"{error:.4f}"])
    return table(("arm", "poses", "changes", "noticed", "median standard error, deg"), rows)


def next_table(out: Path) -> str:
    """Errors before, after proposed poses, and after random ones."""
    rows = []
    for arm, title in ARMS.items():
        found = read(out, "added", arm)
        if not found:
            continue
        better = sum(each["proposed_mm"] < fmean(each["random_mm"]) for each in found)
        rows.append(
            [
                title,
                str(len(found)),
                f"{fmean(each['before_mm'] for each in found):.4f}",
                f"{fmean(each['proposed_mm'] for each in found):.4f}",
                f"{fmean(value for each in found for value in each['random_mm']):.4f}",
                f"{better} of {len(found)}",
            ]
        )
    columns = ("arm", "arms", "before, mm", "proposed, mm", "random, mm", "proposed better")
    return table(columns, rows)


def real_table(paths: Sequence[Path]) -> str:
    """Errors of a real arm in another set-up, and what was said."""
    rows = []
    for path in paths:
        found = json.loads(path.read_text())
        told, (_, one, other) = found["told"], path.stem.split("-")
        moved = ", ".join(
            f"{entry['joint']} by {entry['change']:+.3f}" for entry in told["offsets"] if entry["moved"]
        )
        rows.append(
            [
                f"{one} to {other}",
                told["verdict"],
                f"{told['changed']['p']:.2g}, {told['rest']['p']:.2g}",
                moved or "none",
                f"{found['old_mm']:.3f}",
                f"{found['updated_mm']:.3f}",
            ]
        )
    columns = (
        "set-ups",
        "verdict",
        "p of change, of rest",
        "joints that moved, deg",
        "old, mm",
        "updated, mm",
    )
    return table(columns, rows)


if __name__ == "__main__":
    sys.exit(main())
