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
DEVICES = {
    "silent": "silent as it is connected",
    "silent-under-way": "silent under way",
    "gone": "gone under way",
    "busy": "its port is busy",
    "absent": "its port is absent",
    "closed": "its port is closed",
    "closed-under-way": "its port is closed under way",
}
TAIL = """
## Errors of devices, as they are told

The arm stands when the process has ended; where a device fails as it is connected it has not moved. The
limit is that of all that is tried by then: requests are sent several times, devices connected anew once.

| the table is | within s | ended after s | error |
|---|---|---|---|
"""


def main() -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="directory that the trials wrote to")
    given = parser.parse_args()
    found = {path.stem: json.loads(path.read_text()) for path in sorted(given.results.glob("*.json"))}
    rows = [*killed(found), *faults(found), *stops(found), *long_session(found), *interrupts(found)]
    told = [
        f"| {words} | {each['limit_s']:.1f} | {each['seconds']:.2f} | {each['said']} |"
        for name, words in DEVICES.items()
        if (each := found.get(f"device-{name}"))
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
            f"`kill -9` of {kill['kills']} processes at random moments of {kill['sessions']} sessions",
            "every acknowledged reading there once, the session completes, the same calibration",
            f"all before the end of the session; {kill['acknowledged']} steps acknowledged, "
            f"none lost, none doubled; the same {kill['poses']} of "
            f"{kill['of']} poses as without kills, calibrations the same to the bit",
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
        if content.get("goes_on"):
            told = f"all complete, {content['stopped']} when the same command was given once more"
        elif content["stopped"]:
            told += " by the emergency stop of the cell"
        if content.get("sent_again", 0) > 0:
            told += f"; {content['sent_again']} messages more than without faults"
        if content.get("too_late", 0) > 0:
            told += f", {content['too_late']} answers not in time"
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
            f"{name.removeprefix('stop-')}, {content['share']:g}, {content['sessions']} sessions",
            "stops with the right reason; no wrong reading accepted",
            f'all stopped: "{content["reason"]} ..."; the {content["kept"]} poses that are kept differ by '
            f"{content['worst_mm']:.2f} mm at most from those of sessions without faults",
        )
        for name, content in found.items()
        if name.startswith("stop-")
    ]


def long_session(found: dict) -> list[str]:
    """Time and memory."""
    if "long" not in found:
        return []
    content = found["long"]
    spent_ms = content["process_ms_a_pose"] + content["system_ms_a_pose"]
    missed = "" if spent_ms < MOST_MS_A_POSE else " (missed)"
    return [
        row(
            f"{content['poses']}-pose session",
            f"memory flat, below {MOST_MS_A_POSE:g} ms of process time a pose beside waiting",
            f"{spent_ms:.2f} ms a pose{missed}, two readings each; {content['system_ms_a_pose']:.2f} ms are "
            "the system's for disk and ports; without the calibrations so far (`stretch = 0`), which are "
            "fits at the ends of stretches that grow; memory "
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
            f"Ctrl-C at {content['interrupts']} random moments",
            "robot stopped, file consistent, exit within 2 s, in each state",
            f"robot stopped, file consistent; the slowest ended after {content['slowest_s']:.2f} s; "
            f"{', '.join(f'{state} {count}' for state, count in sorted(content['states'].items()))}",
        )
    ]


if __name__ == "__main__":
    sys.exit(main())
