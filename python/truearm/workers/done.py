"""What became of a task, and the call that finds it out where the task is done."""

import pickle
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Final, Generic, TypeVar, cast

from truearm.errors import TruearmError, WorkError

T = TypeVar("T")
R = TypeVar("R")

ATTEMPTS: Final = 3
CORE: Final = "truearm._core"


@dataclass(frozen=True, eq=False)
class Done(Generic[R]):
    """A finished task.

    Attributes:
        index: Number of its item, from 0.
        value: What the function returned; None if it failed.
        error: What it raised, or that its workers died; None if it succeeded.
        trace: Where an error came from that is a defect; empty otherwise.
    """

    index: int
    value: R | None = None
    error: Exception | None = None
    trace: str = ""

    def result(self) -> R:
        """The value.

        Raises:
            Exception: The task's error, if it failed.
        """
        if self.error is not None:
            if self.trace:
                self.error.add_note(self.trace)
            raise self.error
        return cast("R", self.value)

    def of(self, index: int) -> "Done[R]":
        """The same of the item with this number."""
        return replace(self, index=index)


def answer(function: Callable[[T], R], item: T, caller: str) -> Done[R]:
    """Do a task here, in a worker; errors are answers too.

    Args:
        function: What to do.
        item: With what.
        caller: Version of truearm that asks; another one here is an error.
    """
    here = version("truearm")
    if here != caller:
        return Done(0, error=_other_version(here, caller))
    try:
        return Done(0, value=function(item))
    except Exception as error:  # noqa: BLE001 - the one who asked judges it
        trace = "" if is_expected(error) else traceback.format_exc()
        return Done(0, error=_portable(error), trace=trace)


def is_expected(error: Exception) -> bool:
    """Whether an error is about the input or the machine, and no defect."""
    return isinstance(error, TruearmError | OSError | MemoryError) or type(error).__module__ == CORE


def died() -> WorkError:
    """The error of a task whose workers died each time."""
    return WorkError(
        f"the worker that did this died, {ATTEMPTS} times",
        way_out="Look for too little memory, and at what the workers wrote to stderr",
    )


def not_begun() -> WorkError:
    """The error where a worker ends while it runs the caller's program, from which its task may be."""
    return WorkError(
        "a worker ended before its first task",
        rule="Each worker runs the program that asks for it once more, to find its functions there",
        way_out='Put what the program, which has to be a file, does under: if __name__ == "__main__":',
    )


def plain(error: BaseException) -> Exception:
    """The error of an item or a result that cannot be sent, or of a task that asked its process to exit."""
    return error if isinstance(error, Exception) else WorkError(f"the task ended with {error!r}")


def _other_version(here: str, caller: str) -> WorkError:
    return WorkError(
        f"the worker has truearm {here}",
        rule=f"It must have the version that asks, {caller}",
        way_out="Install it in the environment of the workers",
    )


def _portable(error: Exception) -> Exception:
    """The error, or its words where it cannot be sent."""
    try:
        return cast("Exception", pickle.loads(pickle.dumps(error)))  # noqa: S301 - made a line before
    except Exception:  # noqa: BLE001 - whatever its own pickling raises
        return WorkError(f"{type(error).__name__}: {error}")
