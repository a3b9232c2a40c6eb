"""Messages on options of `truearm calibrate`, in the words of a fleet file."""

import re
from dataclasses import fields
from typing import Final

from truearm.fits.options import CHOICES, CalibrationOptions
from truearm.fits.scheme_options import SchemeOptions
from truearm.rows.splitting import SplitRule
from truearm.units import ANGLE_UNITS, STATED_LENGTH_UNITS

OPTION: Final = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?: (\w+(?:\.\d+)?))?")
NUMBER: Final = re.compile(r"\d+(?:\.\d+)?")
UNITS: Final = {"length_unit": STATED_LENGTH_UNITS, "angle_unit": ANGLE_UNITS}
KEYS: Final = {
    each.name for kind in (CalibrationOptions, SplitRule, SchemeOptions) for each in fields(kind)
} | set(UNITS)
WORDS: Final = {name: tuple(values) for name, values in {**CHOICES, **UNITS}.items()}


def in_keys(text: str) -> str:
    """A text in which options are keys: "give --length-unit mm" says 'give length_unit = "mm"'.

    Options of other commands stay as they are.
    """
    return OPTION.sub(_in_key, text)


def _in_key(found: re.Match[str]) -> str:
    name, value = found[1].replace("-", "_"), found[2]
    if name not in KEYS:
        return found[0]
    if value is None:
        return name
    if NUMBER.fullmatch(value):
        return f"{name} = {value}"
    return f'{name} = "{value}"' if value in WORDS.get(name, ()) else f"{name} {value}"
