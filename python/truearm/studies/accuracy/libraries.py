"""Libraries of the compared methods that do not come with truearm."""

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Final

from truearm.errors import UsageError, list_names

MODULES: Final = {"scikit-learn": "sklearn", "lightgbm": "lightgbm"}


def require(libraries: Iterable[str]) -> None:
    """Raise UsageError, with what to install, unless all libraries are there."""
    missing = sorted({name for name in libraries if name and find_spec(MODULES[name]) is None})
    if missing:
        raise UsageError(
            f"{list_names(missing)} {'is' if len(missing) == 1 else 'are'} not installed",
            rule=f"Some of the compared methods are fitted by {'it' if len(missing) == 1 else 'them'}",
            way_out='Install it with: pip install ".[study]" in the source; or leave them out with --methods',
        )


@contextmanager
def one_thread() -> Iterator[None]:
    """With linear algebra on one thread, as far as that can be asked for, so that times can be compared."""
    if find_spec("threadpoolctl") is None:
        yield
        return
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    with threadpool_limits(1):
        yield


@contextmanager
def quiet() -> Iterator[None]:
    """Without the warnings that a library gives of bounds that are reached and of searches that end early."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
