"""The paper's schemes on public data, beside constant and variable, by the command line.

    python -m benches.schemes OUT [--data DIR]
    python docs/make_comparison.py STUDY OUT

Writes OUT/ARM-SCHEME.json, what `truearm calibrate --json` printed; what is there is not run again.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
# Repeatability as the makers' data sheets state it, mm.
ARMS = {
    "irb120": ("abb-irb-120", "irb120_faro.csv", "0.01"),
    "ur10c": ("ur10", "ur10_ipa_C.csv", "0.1"),
}
SPLINES = "--train-on measurements --membership bspline --composition product"
SCHEMES = {
    "variable": "--model variable --drift none",
    "regions": "--model regions",
    "regions-least-squares": "--model regions --region-ceps least_squares",
    "fcmac": "--model fcmac",
    "fcmac-least-squares": "--model fcmac --region-ceps least_squares",
    "fcmac-measurements": f"--model fcmac {SPLINES}",
    "fcmac-measurements-234": f"--model fcmac {SPLINES} --scheme-joints 2,3,4",
    "cmac": "--model cmac",
}
COMMON = "--use position --train-size 400 --seed 7 --no-refit --json"


def main() -> int:
    """Run what is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=DATA)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for arm, (robot, file, repeatability) in ARMS.items():
        for scheme, options in SCHEMES.items():
            target = given.out / f"{arm}-{scheme}.json"
            if target.exists():
                continue
            words = f"calibrate {robot} {given.data / file} -o {given.out / target.stem} {COMMON} {options}"
            command = [*words.split(), "--repeatability-mm", repeatability]
            program = [str(Path(sys.executable).parent / "truearm"), *command]
            done = subprocess.run(program, capture_output=True, text=True, check=True)
            target.write_text(json.dumps(json.loads(done.stdout)) + "\n")
            sys.stderr.write(f"{target}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
