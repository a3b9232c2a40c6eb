"""A command as tables of commands name it, before it is imported."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """A command of the table: its name, its module, and one line of help.

    The module has a function `command`, or a table COMMANDS of commands below it, whose help its docstring
    `HELP` is. The lines below "Examples:" of a help text are shown as they stand.
    """

    name: str
    module: str
    summary: str
