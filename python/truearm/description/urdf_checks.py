"""Whether a text is a URDF whose joints can be read: what is wrong, and in which line."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from truearm.errors import InputError, did_you_mean

TRIPLES: Final = ("xyz", "rpy")
LIMITS: Final = ("lower", "upper")
MAX_ANGLE_RAD: Final = 4.0 * np.pi
"""Roll, pitch and yaw of two turns and more are degrees."""


@dataclass
class _Joint:
    line: int
    attributes: Mapping[str, str]
    ends: dict[str, str] = field(default_factory=dict)

    @property
    def where(self) -> str:
        name = self.attributes.get("name")
        return f"line {self.line}, a joint without a name" if name is None else f'joint "{name}"'


def check_urdf(text: str) -> None:
    """Check what a parser would stumble over.

    Raises:
        InputError: If the text is not XML or no URDF, is xacro that was not expanded, a number cannot be
            read, a joint has no name, type, parent or child, or names a link that there is not, two joints or
            links have one name, or an angle can only be in degrees.
    """
    elements = _Elements()
    try:
        elements.parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        raise InputError(f"not XML: {error}", rule="A URDF is an XML file") from None
    for joint in elements.joints:
        _check_joint(joint, elements.links)
    _check_names(elements)


class _Elements:
    """What the elements of a URDF say, those that matter kept.

    Attributes:
        parser: To be given the text.
        joints: The joints of the robot, in the order of the file.
        links: Names of its links.
    """

    def __init__(self) -> None:
        self.joints: list[_Joint] = []
        self.links: list[str] = []
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self._path: list[str] = []

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if not self._path and name != "robot":
            raise InputError(f"the XML is a <{name}>", rule="A URDF is a <robot>")
        self._check_expanded(name, attributes)
        self._path.append(name)
        if self._path[1:2] == ["joint"]:
            self._take_joint(name, attributes)
        elif self._path[1:] == ["link"]:
            self.links.append(attributes.get("name", ""))

    def _end(self, _name: str) -> None:
        self._path.pop()

    def _take_joint(self, name: str, attributes: dict[str, str]) -> None:
        if len(self._path) == 2:
            self.joints.append(_Joint(self.parser.CurrentLineNumber, attributes))
        elif len(self._path) == 3:
            for triple in TRIPLES if name in ("origin", "axis") else ():
                if triple in attributes:
                    self._check_triple(name, triple, attributes[triple])
            for limit in LIMITS if name == "limit" else ():
                if limit in attributes:
                    self._check_limit(name, limit, attributes[limit])
            if name in ("parent", "child"):
                self.joints[-1].ends[name] = attributes.get("link", "")

    def _check_expanded(self, name: str, attributes: dict[str, str]) -> None:
        found = [f'"{value}"' for value in attributes.values() if "${" in value or "$(" in value]
        if name.startswith("xacro:"):
            found.append(f"<{name}>")
        if found:
            raise InputError(
                f"{found[0]} in line {self.parser.CurrentLineNumber} is xacro",
                rule="A URDF holds numbers and names only",
                way_out="Expand it first: xacro ROBOT.urdf.xacro > ROBOT.urdf",
            )

    def _check_triple(self, element: str, attribute: str, text: str) -> None:
        values = _numbers(text)
        if len(values) != 3 or not np.isfinite(values).all():
            self._refuse(element, attribute, text, "3 finite numbers")
        if attribute == "rpy" and np.abs(values).max() >= MAX_ANGLE_RAD:
            self._refuse(element, attribute, text, "in rad: if these are degrees, multiply them by pi/180")

    def _check_limit(self, element: str, attribute: str, text: str) -> None:
        values = _numbers(text)
        if len(values) != 1 or np.isnan(values).any():
            self._refuse(element, attribute, text, "a number")

    def _refuse(self, element: str, attribute: str, text: str, wanted: str) -> None:
        raise InputError(
            f'{attribute}="{text}" of <{element}> in line {self.parser.CurrentLineNumber}',
            rule=f"It must be {wanted}",
        )


def _numbers(text: str) -> NDArray[np.float64]:
    """The numbers of a text, none where a word is not one."""
    try:
        return np.array([float(word) for word in text.split()])
    except ValueError:
        return np.empty(0)


def _check_joint(joint: _Joint, links: list[str]) -> None:
    for attribute in ("name", "type"):
        if attribute not in joint.attributes:
            rule = "Every joint needs a name, a type, a parent and a child"
            raise InputError(f"it has no {attribute}", where=joint.where, rule=rule)
    for end in ("parent", "child"):
        link = joint.ends.get(end)
        if not link:
            raise InputError(f"it has no {end} link", where=joint.where, rule="A joint connects two links")
        if link not in links:
            rule = did_you_mean(link, links) or "Every link that a joint names needs a <link> of its own"
            raise InputError(f'its {end} "{link}" is no link of the file', where=joint.where, rule=rule)


def _check_names(elements: _Elements) -> None:
    """Refuse names that stand twice."""
    lines: dict[str, int] = {}
    for joint in elements.joints:
        name = joint.attributes["name"]
        if name in lines:
            raise InputError(
                f"it stands in line {lines[name]} and again in line {joint.line}",
                where=joint.where,
                rule="Every joint needs a name of its own",
            )
        lines[name] = joint.line
    for link in elements.links:
        if elements.links.count(link) > 1:
            raise InputError(f'link "{link}" stands twice', rule="Every link needs a name of its own")
