"""The C functions, call by call: a random walk as in a servo cycle, and random poses."""

import json
import subprocess
import tempfile
from pathlib import Path

import truearm as ta
from benches.field import SEED, TRAINING, calibrate, measurements
from benches.timing import Comparison, Results

ROOT = Path(__file__).resolve().parents[1]
MEDIAN_S, RARE_S = 2e-6, 10e-6
WORDS = {
    "correct_walk": "truearm_correct, random walk",
    "correct_random": "truearm_correct, random poses",
    "predict_walk": "truearm_predict_position, random walk",
    "predict_random": "truearm_predict_position, random poses",
    "stream_walk": "truearm_stream_step, random walk",
}


def timings(calibration: ta.Calibration) -> dict[str, dict[str, float]]:
    """Seconds of each call, by a program that is linked with the library."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.calib"
        calibration.save(path, with_rows=False)
        command = ["cargo", "run", "--release", "--quiet", "-p", "truearm-capi", "--example", "latency", "--"]
        done = subprocess.run([*command, str(path)], cwd=ROOT, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def run() -> Results:
    """Compare medians and 99.9 % with what a servo cycle allows."""
    data, name = measurements()
    comparisons = []
    for model in ("constant", "variable"):
        found = timings(calibrate(data, TRAINING, model=model))
        for key, words in WORDS.items():
            work = f"{words}, {model} model"
            comparisons += [
                Comparison(f"{work}, median", f"{MEDIAN_S * 1e6:g} us", found[key]["median"], MEDIAN_S, 1.0),
                Comparison(f"{work}, 99.9 %", f"{RARE_S * 1e6:g} us", found[key]["p999"], RARE_S, 1.0),
            ]
    remarks = [
        "A million calls each from a Rust program through the C functions, the clock included; fitted to "
        f"{name}, {TRAINING} poses, seed {SEED}. The peer is what a controller allows."
    ]
    return Results("The C library, call by call", comparisons, [], remarks)
