"""Write docs/reference/trials.md from what the trials of the measurement cell gave.

make trials
python docs/make_trials.py build/trials
"""

import argparse
import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "trials.md"
HEAD = """# Trials of the measurement cell

What `make trials` found: `truearm measure` against virtual devices, over pseudo-terminals and TCP, killed,
interrupted and with faults. Small versions of all of these run with the tests. This page is written by
`docs/make_trials.py` from the files that the trials leave in build/trials.

| trial | to show | found |
|---|---|---|
"""
MOST_MS_A_POSE = 1.0
DEVICES = ("silent", "gone", "busy", "absent", "closed")
TAIL = """
## Errors of devices, as they are told

| device | error |
|---|---|
"""


def main() -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="directory that the trials wrote to")
    given = parser.parse_args()
    found = {path.stem: json.loads(path.read_text()) for path in sorted(given.results.glob("*.json"))}
    rows = [*killed(found), *faults(found), *stops(found), *long_session(found), *interrupts(found)]
    told = [
        f"| {name} | {found[f'device-{name}']['said']} |" for name in DEVICES if f"device-{name}" in found
    ]
    PAGE.write_text(HEAD + "\n".join(rows) + "\n" + TAIL + "\n".join(told) + "\n")
    sys.stdout.write(f"written to {PAGE}\n")
    return 0


def row(trial: str, aim: str, result: str) -> str:
    """A line of the table."""
    return f"| {trial} | {aim} | {result} |"


def killed(found: dict) -> list[str]:
    """`kill -9`."""
    if "kill" not in found:
        return []
    kill = found["kill"]
    return [
        row(
            f"`kill -9` at {kill['kills']} random moments of {kill['sessions']} sessions",
            "every acknowledged reading there once, the session completes, the same calibration",
            f"{kill['in_time']} before the end of the session; {kill['acknowledged']} steps acknowledged, "
            f"none lost, none doubled; the same {kill['poses']} of "
            f"{kill['of']} poses as without kills, the same data to the bit",
        )
    ]


def faults(found: dict) -> list[str]:
    """Faults of messages and contacts, and restarts."""
    rows = []
    for name, content in found.items():
        kind = name.removeprefix("fault-")
        if kind == name:
            continue
        sessions = f"{content['sessions']} sessions of {content['poses']} poses"
        told = f"{content['sessions'] - content['stopped']} complete, {content['stopped']} stopped"
        if content["stopped"]:
            told += " by the emergency stop of the cell"
        if "worst_mm" in content:
            told += f"; readings differ by {content['worst_mm']:.2f} mm at most from sessions without faults"
        rows.append(
            row(
                f"{kind}, {content['share']:.0%} of messages or contacts, {sessions}",
                "all complete or stop with the right reason; no wrong reading accepted",
                f"{told}; {content['remarks']} remarks in the session files",
            )
        )
    return rows


def stops(found: dict) -> list[str]:
    """What cannot go on."""
    return [
        row(
            f"{name.removeprefix('stop-')}, {content['sessions']} sessions",
            "stops with the right reason",
            f'all stopped: "{content["reason"]} ..."',
        )
        for name, content in found.items()
        if name.startswith("stop-")
    ]


def long_session(found: dict) -> list[str]:
    """Time and memory."""
    if "long" not in found:
        return []
    content = found["long"]
    missed = "" if content["process_ms_a_pose"] < MOST_MS_A_POSE else " (missed)"
    return [
        row(
            f"{content['poses']}-pose session",
            f"memory flat, below {MOST_MS_A_POSE:g} ms of process time a pose beside waiting",
            f"{content['process_ms_a_pose']:.2f} ms a pose{missed}, two readings each, beside "
            f"{content['system_ms_a_pose']:.2f} ms in which the system serves disk and ports; memory "
            f"changed by {content['grown_mb']:+.1f} MB to {content['memory_mb']:.0f} MB in the last three "
            "quarters",
        )
    ]


def interrupts(found: dict) -> list[str]:
    """Ctrl-C."""
    if "interrupt" not in found:
        return []
    content = found["interrupt"]
    return [
        row(
            f"Ctrl-C in {content['interrupts']} states",
            "robot stopped, file consistent, exit within 2 s",
            f"the slowest ended after {content['slowest_s']:.2f} s",
        )
    ]


if __name__ == "__main__":
    sys.exit(main())
