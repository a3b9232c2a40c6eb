"""Tables that a record keeps for itself: what it hands out are copies."""

from collections.abc import Callable
from typing import TypeVar

import pandas as pd

T = TypeVar("T")


class _Copies:
    """Internal: a field of a frozen dataclass, a table of which everyone gets a copy."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, record: object, kind: type | None = None) -> "pd.DataFrame | _Copies":
        if record is None:  # asked of the class, as tools that document it do
            return self
        table: pd.DataFrame = record.__dict__[self._name]
        return table.copy()

    def __set__(self, record: object, table: pd.DataFrame) -> None:
        record.__dict__[self._name] = table.copy()


def keeping(name: str) -> Callable[[type[T]], type[T]]:
    """A decorator of frozen dataclasses, whose table `name` no one else can change."""

    def keep(kind: type[T]) -> type[T]:
        setattr(kind, name, _Copies(name))
        return kind

    return keep
