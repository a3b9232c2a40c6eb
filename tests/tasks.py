"""Tasks for workers; a light module, for every worker imports it."""

import os
import sys
import time

from truearm.errors import InputError

LONG_S = 60.0


class UnsendableError(Exception):
    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")


def cube(number):
    if number < 0:
        raise InputError(f"{number} is negative", rule="It must not be")
    return number**3


def bad_answer(kind):
    if kind == "exits":
        sys.exit(3)
    if kind == "own error":
        raise UnsendableError(1, 2)
    if kind == "bug":
        return 1 / 0
    return lambda: 0  # cannot be pickled


def native_threads(variable):
    return os.environ.get(variable)


def die_sometimes(item):
    """Each call leaves a mark in a folder; ends its process unless there are as many marks as it needs."""
    folder, name, needed = item
    (folder / f"{name}.{time.monotonic_ns()}").touch()
    if len(list(folder.glob(f"{name}.*"))) < needed:
        os._exit(1)
    return name


def wait_to_be_killed(item):
    """The first call waits, and says which process it is; later ones return at once."""
    folder, name = item
    try:
        with (folder / name).open("x") as file:
            file.write(str(os.getpid()))
    except FileExistsError:
        return name
    time.sleep(LONG_S)
    return "never killed"
