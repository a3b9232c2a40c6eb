"""Figures on public data: run the command line on real measurements, seed by seed.

    python -m benches.figures OUT [--data DIR] [--seeds 10] [--only NAME]
    python docs/make_results.py OUT

Writes OUT/NAME/case.json and OUT/NAME/seed-S/summary.json and cost.json, or evaluation.json; what is there is
not run again. The first seed is 7, for which targets are stated; the others follow from 0.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

FIRST_SEED = 7
DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
BYTES_OF_PEAK = 1 if sys.platform == "darwin" else 1024
MEGABYTE = 1e6


@dataclass(frozen=True)
class Case:
    """One question to the data.

    Attributes:
        name: Short name, a directory.
        title: What is asked, in words.
        robot: Arm of the library.
        files: What is calibrated from.
        options: How.
        target_mean_mm: Mean of the variable model that was to be reached.
        judge: File of another set-up that judges; "" to judge held-out rows.
        judge_options: How it judges.
        draws: Evaluations of the first seed's calibration, in place of one for each seed; 0 for none.
    """

    name: str
    title: str
    robot: str
    files: list[str]
    options: list[str] = field(default_factory=list)
    target_mean_mm: float | None = None
    judge: str = ""
    judge_options: list[str] = field(default_factory=list)
    draws: int = 0


A, B, C = "ur10_ipa_A.csv", "ur10_ipa_B.csv", "ur10_ipa_C.csv"
IRB, UR5 = "irb120_faro.csv", "ur5_gtpn.csv"


def _ur10(name, title, file, target, options=""):
    return Case(name, f"UR10, {title}", "ur10", [file], options.split(), target)


def _irb(name, title, target, options=""):
    return Case(name, f"IRB 120, {title}", "abb-irb-120", [IRB], options.split(), target)


def _to_b(name, title, files, size, target):
    return Case(name, f"UR10, {title}", "ur10", files, ["--train-size", str(size)], target, B)


GOALS = "--split-by goal_x,goal_y,goal_z"
CASES = [
    _ur10("c400", "set-up C, 400 poses", C, 0.095, "--train-size 400"),
    _ur10("b400", "set-up B, 400 poses", B, 0.100, "--train-size 400"),
    _irb("irb400", "400 poses", 0.066, "--train-size 400"),
    Case("ur5", "UR5, 400 poses", "ur5", [UR5], ["--train-size", "400"], 0.336),
    _ur10("call", "set-up C, all training rows", C, 0.082),
    _ur10("c100", "set-up C, 100 poses", C, 0.15, "--train-size 100"),
    _irb("irb100", "100 poses", 0.098, "--train-size 100"),
    _ur10("c30", "set-up C, 30 poses", C, None, "--train-size 30"),
    _irb("irb30", "30 poses", None, "--train-size 30"),
    _ur10("a1000", "set-up A, whole positions held out, 1000 poses", A, 0.088, f"{GOALS} --train-size 1000"),
    _ur10("aall", "set-up A, whole positions held out, all training rows", A, 0.078, GOALS),
    _to_b("a2b", "900 poses of set-up A, judged on B", [A], 900, 0.27),
    _to_b("ac2b", "600 poses each of set-ups A and C, judged on B", [A, C], 600, 0.20),
    replace(_to_b("a2b10", "900 poses of set-up A, judged on B, ten frame rows, A's target", [A], 900, 0.36),
            judge_options=["--frame-rows", "10", "--keep-tool"], draws=20),
    _irb("irb1to2", "400 poses, target 1 fitted, target 2 judged", 0.25, "--train-size 400 --judge-target 2"),
    _irb("irb12to3", "400 poses, targets 1 and 2 fitted, target 3 judged", 0.10,
         "--train-size 400 --use targets --judge-target 3"),
    _ur10("ctail1", "set-up C, upper 30 % of joint 1 held out", C, None, "--holdout-range q1:high:0.3"),
    _ur10("ctail", "set-up C, upper 30 % of joint 2 held out", C, None, "--holdout-range q2:high:0.3"),
    _ur10("btail", "set-up B, upper 30 % of joint 2 held out", B, None, "--holdout-range q2:high:0.3"),
    _irb("irbtail", "upper 30 % of joint 2 held out", None, "--holdout-range q2:high:0.3"),
]  # fmt: skip


def main() -> int:
    """Run the cases that are asked for and not there yet."""
    parser = argparse.ArgumentParser(prog="python -m benches.figures", description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--only", choices=[case.name for case in CASES], action="append")
    given = parser.parse_args()
    if not given.data.is_dir():
        parser.error(f"there is no measurement data at {given.data}; name its directory with --data")
    for order, case in enumerate(CASES):
        if not given.only or case.name in given.only:
            out = given.out / case.name
            out.mkdir(parents=True, exist_ok=True)
            (out / "case.json").write_text(json.dumps({"order": order, **asdict(case)}, indent=2))
            run(case, out, given.data, given.seeds)
    return 0


def run(case: Case, out: Path, data: Path, count: int) -> None:
    """Fit and judge one case for each seed, or judge one fit for each draw."""
    for seed in seeds(case.draws or count):
        folder = out / f"seed-{seed}"
        fitted = out / f"seed-{FIRST_SEED}" if case.draws else folder
        if not (fitted / "summary.json").exists():
            calibrate(case, fitted, data, FIRST_SEED if case.draws else seed)
        if case.judge and not (folder / "evaluation.json").exists():
            folder.mkdir(exist_ok=True)
            judged = [str(fitted / "calibration.calib"), str(data / case.judge)]
            options = ["--use", "position", "--seed", str(seed), *case.judge_options]
            (folder / "evaluation.json").write_text(truearm("evaluate", *judged, *options))
        sys.stdout.write(f"{case.name} seed {seed}\n")


def calibrate(case: Case, folder: Path, data: Path, seed: int) -> None:
    """Fit to training rows alone."""
    files = [str(data / name) for name in case.files]
    use = [] if "--use" in case.options else ["--use", "position"]
    options = [*use, "--seed", str(seed), "--no-refit", *case.options]
    cost = what_it_takes("calibrate", case.robot, *files, "-o", str(folder), *options)
    (folder / "cost.json").write_text(json.dumps(cost))


def seeds(count: int) -> list[int]:
    """The first seed and those that follow."""
    return [FIRST_SEED, *(seed for seed in range(count) if seed != FIRST_SEED)][:count]


def truearm(*arguments: str) -> str:
    """What the command prints as JSON; its progress goes to our stderr."""
    return subprocess.run(_command(*arguments), stdout=subprocess.PIPE, text=True, check=True).stdout


def what_it_takes(*arguments: str) -> dict[str, float | None]:
    """Seconds by the clock and the largest memory, in MB, of a command, and how many cores there are."""
    started = time.monotonic()
    command = _command(*arguments)
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    peak = usage.ru_maxrss * BYTES_OF_PEAK / MEGABYTE
    return {"seconds": time.monotonic() - started, "peak_mb": peak, "cores": os.cpu_count()}


def _command(*arguments: str) -> list[str]:
    return [str(Path(sys.executable).parent / "truearm"), *arguments, "--json"]


if __name__ == "__main__":
    sys.exit(main())
