"""Figures on public data: run the command line on real measurements, seed by seed.

    python -m benches.figures OUT [--data DIR] [--seeds 10] [--only NAME]
    python docs/make_results.py OUT

Writes OUT/NAME/case.json and OUT/NAME/seed-S/summary.json or evaluation.json; what is there is not run again.
The first seed is 7, for which targets are stated; the others follow from 0.
"""

import argparse
import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path

FIRST_SEED = 7
DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@dataclass(frozen=True)
class Case:
    """One question to the data: what is fitted to what, what judges it, and the mean to reach."""

    name: str
    title: str
    robot: str
    files: list[str]
    options: list[str] = field(default_factory=list)
    judge: str = ""
    judge_options: list[str] = field(default_factory=list)
    target_mean_mm: float | None = None


def _case(name, title, robot, file, target, *options):
    return Case(name, title, robot, [file], list(options), target_mean_mm=target)


A, B, C = "ur10_ipa_A.csv", "ur10_ipa_B.csv", "ur10_ipa_C.csv"
IRB, UR5 = "irb120_faro.csv", "ur5_gtpn.csv"
GOALS = ("--split-by", "goal_x,goal_y,goal_z")
CASES = [
    _case("c400", "UR10, set-up C, 400 poses", "ur10", C, 0.095, "--train-size", "400"),
    _case("b400", "UR10, set-up B, 400 poses", "ur10", B, 0.100, "--train-size", "400"),
    _case("irb400", "IRB 120, 400 poses", "abb-irb-120", IRB, 0.066, "--train-size", "400"),
    _case("ur5", "UR5, 400 poses", "ur5", UR5, 0.336, "--train-size", "400"),
    _case("call", "UR10, set-up C, all training rows", "ur10", C, 0.082),
    _case("c100", "UR10, set-up C, 100 poses", "ur10", C, 0.15, "--train-size", "100"),
    _case("irb100", "IRB 120, 100 poses", "abb-irb-120", IRB, 0.098, "--train-size", "100"),
    _case("c30", "UR10, set-up C, 30 poses", "ur10", C, None, "--train-size", "30"),
    _case("irb30", "IRB 120, 30 poses", "abb-irb-120", IRB, None, "--train-size", "30"),
    _case("a1000", "UR10, set-up A, whole positions held out, 1000 poses", "ur10", A, 0.088,
          *GOALS, "--train-size", "1000"),
    _case("aall", "UR10, set-up A, whole positions held out, all training rows", "ur10", A, 0.078, *GOALS),
    _case("ctail", "UR10, set-up C, upper 30 % of joint 2 held out", "ur10", C, None,
          "--holdout-range", "q2:high:0.3"),
    _case("irb1to2", "IRB 120, fitted to target 1, judged at target 2, 400 poses", "abb-irb-120", IRB, 0.25,
          "--train-size", "400", "--judge-target", "2"),
    _case("irb12to3", "IRB 120, fitted to targets 1 and 2, judged at target 3, 400 poses", "abb-irb-120", IRB,
          0.10, "--train-size", "400", "--use", "targets", "--judge-target", "3"),
    Case("a2b", "UR10, from set-up A, 900 poses, to B", "ur10", [A], ["--train-size", "900", "--no-refit"], B,
         [], 0.27),
    Case("ac2b", "UR10, from set-ups A and C, 600 poses each, to B", "ur10", [A, C],
         ["--train-size", "600", "--no-refit"], B, [], 0.20),
    Case("a2b10", "UR10, from set-up A, 900 poses, to B with ten frame rows and A's target", "ur10", [A],
         ["--train-size", "900", "--no-refit"], B, ["--frame-rows", "10", "--keep-tool"], 0.36),
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
    for case in CASES:
        if not given.only or case.name in given.only:
            run(case, given.out / case.name, given.data, seeds(given.seeds))
    return 0


def seeds(count: int) -> list[int]:
    """The first seed and those that follow."""
    return [FIRST_SEED, *(seed for seed in range(count) if seed != FIRST_SEED)][:count]


def run(case: Case, out: Path, data: Path, chosen: list[int]) -> None:
    """Fit and judge one case for each seed."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "case.json").write_text(json.dumps(asdict(case), indent=2))
    for seed in chosen:
        folder = out / f"seed-{seed}"
        if not (folder / "summary.json").exists():
            files = [str(data / name) for name in case.files]
            use = [] if "--use" in case.options else ["--use", "position"]
            options = [*use, "--seed", str(seed), *case.options]
            truearm("calibrate", case.robot, *files, "-o", str(folder), *options)
        if case.judge and not (folder / "evaluation.json").exists():
            judged = [str(folder / "calibration.calib"), str(data / case.judge)]
            options = ["--use", "position", "--seed", str(seed), *case.judge_options]
            (folder / "evaluation.json").write_text(truearm("evaluate", *judged, *options))
        sys.stdout.write(f"{case.name} seed {seed}\n")


def truearm(*arguments: str) -> str:
    """What the command prints as JSON; its progress goes to our stderr."""
    program = Path(sys.executable).parent / "truearm"
    command = [str(program), *arguments, "--json"]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=os.environ).stdout


if __name__ == "__main__":
    sys.exit(main())
