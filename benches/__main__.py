"""Run the benchmarks: python -m benches [--write] [NAME ...]."""

import argparse
import importlib
import platform
import subprocess
import sys
from pathlib import Path

from benches.ours import one_thread

BENCHMARKS = [
    "kinematics",
    "calibration",
    "field",
    "compensation",
    "programs",
    "networks",
    "planning",
    "latency",
    "fleet",
]
PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "performance.md"
HEAD = """# Performance

Measured by `make bench BENCH=--write`, which writes this page; truearm and its peers ran in one process after
the other on the same machine and were checked to give the same answers. One thread unless it says otherwise,
medians of repeated calls. A ratio says how many times faster truearm is than the peer beside it; what is to
reach is the goal that the project set itself.
"""


def main() -> int:
    """Run what is asked for, print it, and keep it in the documentation if asked to."""
    parser = argparse.ArgumentParser(prog="python -m benches", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"of {', '.join(BENCHMARKS)}; all by default"
    )
    parser.add_argument("--write", action="store_true", help=f"write the results to {PAGE.name}")
    given = parser.parse_args()
    if given.write and given.names:
        parser.error("--write keeps a whole run: leave the names out")
    unknown = sorted(set(given.names) - set(BENCHMARKS))
    if unknown:
        parser.error(f"no benchmark {unknown[0]!r}; there are {', '.join(BENCHMARKS)}")
    one_thread()
    pages = []
    for name in given.names or BENCHMARKS:
        pages.append(_run(name))
        print(pages[-1], flush=True)
    if given.write:
        PAGE.write_text("\n".join([HEAD, machine(), *pages]).rstrip() + "\n")
        print(f"written to {PAGE}")
    return 0


def _run(name: str) -> str:
    """Results of one benchmark as Markdown; imported only now, when the threads are settled."""
    timing = importlib.import_module("benches.timing")
    return str(timing.markdown(importlib.import_module(f"benches.{name}").run()))


def machine() -> str:
    """Processor, system and versions, as a list."""
    versions = subprocess.run(
        [sys.executable, "-m", "pip", "freeze", "--exclude-editable"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    peers = [line for line in versions if line.split("==")[0] in {"numpy", "scipy", "scikit-learn", "pin"}]
    return f"- processor: {processor()}\n- Python {platform.python_version()}, {', '.join(peers)}\n"


def processor() -> str:
    """Name of the processor, as the system gives it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return f"{len(names)} x {names[0]}" if names else platform.processor() or platform.machine()


if __name__ == "__main__":
    sys.exit(main())
