"""The paper's FCMAC, 27 cells of 15 CEPs, against vectorised NumPy: output and training."""

import json
import sys
from functools import cache, partial
from typing import Any

import numpy as np

from benches.ours import measured_with_threads
from benches.timing import Comparison, Results, seconds_of
from truearm import _core

CELLS, ACTIVE, OUTPUTS, SIGMA, RATE = (17, 11, 11), 3, 15, 0.5, 0.5
INPUTS, PATTERNS, EPOCHS = 10_000, 880, 200
OUTPUT_TARGET, CEILING_TARGET = 6.0, 0.5
OUTPUT_CEILING_S, UPDATE_CEILING_S = 73e-9, 100e-9
LOW, HIGH = np.deg2rad([[-150.0, -30.0, -120.0], [150.0, 100.0, 0.0]])
SAME = 1e-12


@cache
def network():
    sensors = [(LOW[k], HIGH[k], CELLS[k], ACTIVE) for k in range(3)]
    options: Any = {"membership": "gaussian", "sigma": SIGMA, "composition": "min", "table": None}
    empty = _core.Network(sensors, OUTPUTS, options)
    return empty.with_weights(np.random.default_rng(0).normal(size=(empty.table_size, OUTPUTS)))


def inputs(count):
    return np.random.default_rng(1).uniform(LOW, HIGH, (count, 3))


def patterns():
    s = inputs(PATTERNS)
    return s, 1e-3 * np.sin(s[:, :1] * np.arange(1, OUTPUTS + 1))


def numpy_active(s):
    """Cells and grades (n, A): the nearest cells along each input, and their combinations."""
    cells, grades = np.zeros((len(s), 1), dtype=np.int64), np.ones((len(s), 1))
    for k, count in enumerate(CELLS):
        position = (s[:, k] - LOW[k]) / (HIGH[k] - LOW[k]) * (count - 1)
        first = np.clip(np.ceil(position - 0.5 * ACTIVE), 0, count - ACTIVE).astype(np.int64)
        window = first[:, None] + np.arange(ACTIVE)
        along = np.exp(-0.5 * ((position[:, None] - window) / SIGMA) ** 2)
        cells = (cells[:, :, None] * count + window[:, None, :]).reshape(len(s), -1)
        grades = np.minimum(grades[:, :, None], along[:, None, :]).reshape(len(s), -1)
    return cells, grades


def numpy_output(weights, s):
    cells, grades = numpy_active(s)
    return np.einsum("na,nap->np", grades, weights[cells]) / grades.sum(axis=1, keepdims=True)


def numpy_epoch(weights, cells, grades, wanted):
    """One update after the other, as rule (A5) has it."""
    for rows, mu, cep in zip(cells, grades, wanted, strict=True):
        difference = cep - mu @ weights[rows] / mu.sum()
        weights[rows] += RATE * mu[:, None] * difference


def run():
    """Compare, and check that both give the same outputs."""
    ours = measured_with_threads("networks", 1)
    weights, s = network().weights, inputs(INPUTS)
    difference = np.abs(numpy_output(weights, s) - network().output(s)).max()
    if difference > SAME:
        raise AssertionError(f"outputs differ by {difference:g}")
    peer_output = seconds_of(lambda: numpy_output(weights, s), repeats=3) / INPUTS
    trained, wanted = patterns()
    cells, grades = numpy_active(trained)
    peer_update = seconds_of(lambda: numpy_epoch(weights, cells, grades, wanted), repeats=3) / PATTERNS
    output, update = "FCMAC output, 27 cells x 15, random inputs", "one training update, 27 cells x 15"
    before = "hand-written Rust, timed apart"
    comparisons = [
        Comparison(output, "NumPy, vectorised", ours["output"], peer_output, OUTPUT_TARGET),
        Comparison(output, before, ours["output"], OUTPUT_CEILING_S, CEILING_TARGET),
        Comparison(update, "NumPy", ours["update"], peer_update),
        Comparison(update, before, ours["update"], UPDATE_CEILING_S, CEILING_TARGET),
    ]
    remarks = [
        f"Outputs in batches of {INPUTS}; updates in up to {EPOCHS} epochs of {PATTERNS} "
        "patterns, the search for their cells included."
    ]
    return Results("FCMAC", comparisons, [], remarks)


def own_timings():
    """Our side, in as many threads as this process has."""
    s, out = inputs(INPUTS), np.empty((INPUTS, OUTPUTS))
    trained, wanted = patterns()
    options = {
        "columns": [1] * OUTPUTS,
        "rate": RATE,
        "normalise": "printed",
        "tolerance": 0.0,
        "epochs": EPOCHS,
    }
    train = partial(network().train, trained, wanted, options)
    return {
        "output": seconds_of(lambda: network().output(s, out)) / INPUTS,
        "update": seconds_of(train) / (train().epochs * PATTERNS),
    }


if __name__ == "__main__":
    json.dump(own_timings(), sys.stdout)
