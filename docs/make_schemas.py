"""Write docs/reference/schemas/*.json: JSON schemas of the TOML files, from the classes that read them."""

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from truearm.cell.cell_file import CellFile
from truearm.cell.drivers import ROBOTS, SENSORS
from truearm.description.robot_file import RobotFile
from truearm.fleet.fleet_file import ArmSection, DefaultsSection, FleetFile
from truearm.programs.frames import FramesFile

FOLDER = Path(__file__).parent / "reference" / "schemas"
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schemas() -> dict[str, dict[str, Any]]:
    """The schemas by name of file, as they have to be."""
    return {
        "robot.json": _schema(RobotFile, "Robot file of truearm"),
        "frames.json": _schema(FramesFile, "Frames file of truearm"),
        "cell.json": _cell(),
        "fleet.json": _fleet(),
    }


def text_of(schema: dict[str, Any]) -> str:
    """A schema as it is written."""
    return json.dumps(schema, indent=1) + "\n"


def _schema(model: type[BaseModel], title: str) -> dict[str, Any]:
    return {"$schema": DIALECT, **model.model_json_schema(), "title": title}


def _cell() -> dict[str, Any]:
    """The cell file; its robot and sensor are those of a known driver, or have a driver "module:Class"."""
    schema = _schema(CellFile, "Cell file of truearm")
    definitions = schema.setdefault("$defs", {})
    for key, drivers in (("robot", ROBOTS), ("sensor", SENSORS)):
        choices = []
        for name, place in drivers.items():
            module, _, attribute = place.partition(":")
            section = getattr(import_module(module), attribute).Settings.model_json_schema()
            definitions |= section.pop("$defs", {})
            section["properties"]["driver"] = {"const": name}
            section["required"] = sorted({*section.get("required", ()), "driver"})
            choices.append({**section, "title": name})
        own = {"properties": {"driver": {"type": "string", "pattern": ":"}}, "required": ["driver"]}
        schema["properties"][key] = {"anyOf": [*choices, {**own, "title": "a driver of your own"}]}
    return schema


def _fleet() -> dict[str, Any]:
    """The fleet file, with the sections that are checked arm by arm."""
    schema = _schema(FleetFile, "Fleet file of truearm")
    sections: dict[str, type[BaseModel]] = {"defaults": DefaultsSection, "arm": ArmSection}
    parts = {key: model.model_json_schema() for key, model in sections.items()}
    for part in parts.values():
        files = part["properties"]["measurements"]
        files["anyOf"] = [{"type": "string", "minLength": 1}, *files["anyOf"]]
    schema["properties"]["defaults"] = parts["defaults"]
    schema["properties"]["arm"]["items"] = parts["arm"]
    return schema


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, schema in schemas().items():
        (FOLDER / name).write_text(text_of(schema))
    sys.stdout.write(f"written to {FOLDER}\n")
