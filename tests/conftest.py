"""Shared settings and fixtures."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from truearm.workers.local import THREAD_VARIABLES

ROOT = Path(__file__).resolve().parents[1]
SHARED_DATA = ROOT.parent / "shared" / "data"

# One machine, one answer: a test that failed yesterday fails today, and a slow machine is no failure.
settings.register_profile("truearm", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("truearm")

# Tests that run side by side share the processors already.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1") | os.environ)


@pytest.fixture(scope="session", autouse=True)
def interruptible() -> Iterator[None]:
    """Where tests run in the background Ctrl-C is ignored, and the programs they start would inherit that."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def root() -> Path:
    """The top of the repository."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Measurements of real arms made by other people, kept beside the repository and never in it."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"public measurement data is not at {SHARED_DATA}")
    return SHARED_DATA
