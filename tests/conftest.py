"""Shared settings and fixtures."""

from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]
SHARED_DATA = ROOT.parent / "shared" / "data"

# One machine, one answer: a test that failed yesterday fails today, and a slow machine is no failure.
settings.register_profile("truearm", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("truearm")


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
