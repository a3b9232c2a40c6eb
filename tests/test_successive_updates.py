"""What is uncertain after updates of updates, against the same written out densely."""

from collections import Counter

import numpy as np
import pytest

from truearm.certainty.uncertainty import SetupPlace, UpdatedSpread
from truearm.revision import Carried

ROWS, LINKS, SETUP, ARM = 4, 3, 6, 2


class Harmonic:
    """Parameters `a + b sin(input)` that are uncertain together with the set-up's unknowns."""

    def __init__(self, rng):
        root = rng.normal(size=(10 * LINKS + SETUP, 10 * LINKS + SETUP))
        self.of_all = root @ root.T
        self.asked = Counter[str]()

    def rows(self, inputs, jacobian, setup):
        setup = np.zeros((*jacobian.shape[:2], SETUP)) if setup is None else setup
        found = np.concatenate([jacobian, jacobian * np.sin(inputs)[:, :, None], setup], axis=2)
        return found.reshape(-1, found.shape[2])

    def joint(self, inputs, jacobian, setup=None):
        self.asked["joint"] += 1
        rows = self.rows(inputs, jacobian, setup)
        return rows @ self.of_all @ rows.T

    def cross(self, first, inputs, jacobian, setup):
        self.asked["cross"] += 1
        rows, split = self.rows(inputs, jacobian, setup), first * jacobian.shape[1]
        return rows[:split] @ self.of_all @ rows[split:].T

    def each(self, inputs, jacobian, setup):
        self.asked["each"] += 1
        pairs = zip(inputs, jacobian, [None] * len(inputs) if setup is None else setup, strict=True)
        rows = [self.rows(i[None], j[None], None if s is None else s[None]) for i, j, s in pairs]
        return np.array([row @ self.of_all @ row.T for row in rows])


def place():
    return SetupPlace(np.zeros((12, SETUP)), np.zeros((12, SETUP)))


def drawn(rng, m):
    """An update whose rows have m values."""
    root = rng.normal(size=(ARM + SETUP, ARM + SETUP))
    return Carried(
        response=0.1 * rng.normal(size=(ARM + SETUP, ROWS * m)),
        own=root @ root.T,
        inputs=rng.normal(size=(ROWS, 1)),
        jacobian=rng.normal(size=(ROWS, m, 5 * LINKS)),
        setup=rng.normal(size=(ROWS, m, SETUP)),
        tied=np.diag(rng.integers(2, size=SETUP).astype(float)),
    )


def chain(origin, updates):
    """Spreads after each of the updates, which are (offsets, carried)."""
    spreads = [origin]
    for offsets, carried in updates:
        spreads.append(UpdatedSpread(spreads[-1], offsets, carried.own, carried, place()))
    return spreads


def written_out(origin, updates, inputs, jacobian, setup):
    """Covariance of all rows: errors as maps of what was uncertain at first and of what each update added."""
    width = len(origin.of_all) + len(updates) * (ARM + SETUP)

    def errors(k, inputs, jacobian, setup):
        found = np.zeros((jacobian.shape[0] * jacobian.shape[1], width))
        if k == 0:
            found[:, : len(origin.of_all)] = origin.rows(inputs, jacobian, setup)
            return found
        offsets, update = updates[k - 1]
        rows = np.concatenate([jacobian @ offsets, setup], axis=2).reshape(len(found), -1)
        shown = errors(k - 1, update.inputs, update.jacobian, update.setup)
        start = len(origin.of_all) + (k - 1) * (ARM + SETUP)
        found[:, start : start + ARM + SETUP] = rows
        return found + errors(k - 1, inputs, jacobian, setup @ update.tied) - rows @ update.response @ shown

    uncertain = np.zeros((width, width))
    uncertain[: len(origin.of_all), : len(origin.of_all)] = origin.of_all
    for k, (_, update) in enumerate(updates):
        start = len(origin.of_all) + k * (ARM + SETUP)
        uncertain[start : start + ARM + SETUP, start : start + ARM + SETUP] = update.own
    rows = errors(len(updates), inputs, jacobian, setup)
    return rows @ uncertain @ rows.T


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("m", [3, 6])
def test_updates_of_updates_are_as_uncertain_as_written_out(rng, count, m):
    origin = Harmonic(rng)
    updates = [(rng.normal(size=(5 * LINKS, ARM)), drawn(rng, 3 + 3 * (k % 2))) for k in range(count)]
    asked = rng.normal(size=(5, 1)), rng.normal(size=(5, m, 5 * LINKS)), rng.normal(size=(5, m, SETUP))
    for setup in (asked[2], None):
        spread = chain(origin, updates)[-1]
        there = np.zeros_like(asked[2]) if setup is None else setup
        whole = written_out(origin, updates, *asked[:2], there)
        told = {"rtol": 1e-12, "atol": 1e-12 * whole.max()}
        np.testing.assert_allclose(spread.joint(*asked[:2], setup), whole, **told)
        np.testing.assert_allclose(spread.cross(2, *asked[:2], setup), whole[: 2 * m, 2 * m :], **told)
        blocks = [whole[m * k : m * (k + 1), m * k : m * (k + 1)] for k in range(5)]
        np.testing.assert_allclose(spread.each(*asked[:2], setup), blocks, **told)


def test_what_was_uncertain_at_first_is_asked_as_often_after_six_updates_as_after_one(rng):
    updates = [(rng.normal(size=(5 * LINKS, ARM)), drawn(rng, 3)) for _ in range(6)]
    asked = rng.normal(size=(5, 1)), rng.normal(size=(5, 3, 5 * LINKS)), None
    often = []
    for count in (1, 6):
        origin = Harmonic(rng)
        chain(origin, updates[:count])[-1].each(*asked)
        often.append(origin.asked)
    assert often[0] == often[1] == {"joint": 1, "cross": 1, "each": 1}
