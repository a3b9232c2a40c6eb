"""The names that the links and joints of a chain have in its URDF."""

from dataclasses import dataclass


@dataclass(frozen=True)
class UrdfNames:
    """Names of a chain with N joints that move.

    Attributes:
        base_link: The link in whose frame poses are given.
        joints: The N joints that move.
        links: The N links that they move.
        tip_link: The link that is the flange.
    """

    base_link: str
    joints: tuple[str, ...]
    links: tuple[str, ...]
    tip_link: str
