"""Stages of long work: whoever wants to know is told their names."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

Stages = Callable[[str], AbstractContextManager[Any]]
"""Called with the name of each stage; gives a context manager that surrounds it."""


def no_stages(_: str) -> AbstractContextManager[None]:
    """Says nothing about the stages of the work."""
    return nullcontext()
