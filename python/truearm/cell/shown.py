"""Values in messages."""

from typing import Final

LONGEST_SHOWN: Final = 60


def shown(value: object) -> str:
    """A value as it stands in a message, cut where it is long."""
    words = repr(value)
    return words if len(words) <= LONGEST_SHOWN else f"{words[:LONGEST_SHOWN]} ..."
