"""Cell files to begin with."""

from importlib import resources
from typing import Final

SIMULATED: Final = ("rv-m2", "ur", "tracker")
"""Those whose devices have virtual counterparts."""
EXAMPLES: Final = (*SIMULATED, "playback")


def example(name: str) -> str:
    """The text of an example by name."""
    return (resources.files(__name__) / f"{name}.toml").read_text(encoding="utf-8")
