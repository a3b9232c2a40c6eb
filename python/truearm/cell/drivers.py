"""Drivers by name, and users' own ones by module and class."""

import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel

from truearm.cell.schema import checked
from truearm.errors import InputError, did_you_mean

ROBOTS: Final = {
    "rv-m2": "truearm.cell.rv_m2:RvM2",
    "ur": "truearm.cell.universal_robots:UniversalRobots",
    "line": "truearm.cell.line_robot:LineRobot",
    "playback": "truearm.cell.playback:PlaybackRobot",
}
SENSORS: Final = {
    "table-panel": "truearm.cell.table_panel:TablePanel",
    "line": "truearm.cell.line_sensor:LineSensor",
    "playback": "truearm.cell.playback:PlaybackSensor",
}


def driver_and_settings(
    section: Mapping[str, Any], known: Mapping[str, str], *, where: str, folder: Path = Path()
) -> tuple[type[Any], BaseModel]:
    """The class of a driver, and its section of the cell file as an object of the driver's Settings.

    Args:
        section: The section; its key `driver` is a name, or "package.module:Class".
        known: Drivers by name.
        where: The section, for messages.
        folder: Where modules that are not installed are looked for: the folder of the cell file.

    Raises:
        InputError: If there is no such driver, or a key breaks a rule.
    """
    name = section.get("driver")
    if not isinstance(name, str):
        raise InputError('key "driver" is missing', where=where, rule=f"One of {', '.join(known)}")
    place = known.get(name, name)
    if ":" not in place:
        raise InputError(
            f'there is no driver "{name}"',
            where=where,
            rule=f'One of {", ".join(known)}, or "package.module:Class" for your own',
            way_out=did_you_mean(name, list(known)),
        )
    module, _, attribute = place.partition(":")
    beside = str(folder.resolve())
    if name not in known and beside not in sys.path:
        sys.path.append(beside)
    try:
        driver = getattr(import_module(module), attribute)
    except Exception as error:  # noqa: BLE001 - a module of a user's own may raise anything
        raise InputError(
            f'driver "{name}" cannot be imported: {type(error).__name__}: {error}',
            where=where,
            rule=f"Its module is installed, on PYTHONPATH or in {beside}",
        ) from None
    settings = getattr(driver, "Settings", None)
    if not (isinstance(settings, type) and issubclass(settings, BaseModel)):
        raise InputError(
            f'driver "{name}" has no class Settings',
            where=where,
            rule="It must be a pydantic model of its keys",
        )
    return driver, checked(settings, section, where=where)
