"""The version of truearm that is installed."""

from importlib.metadata import version
from typing import Final

__version__: Final = version("truearm")
