"""The plotting script, compressed, and its licence notice."""

import base64
import gzip
from functools import cache
from importlib.resources import files

SCRIPT = ("package_data", "plotly.min.js")


@cache
def plotting_script() -> str:
    """plotly.js as base64 of gzip; the same bytes every time."""
    return base64.b64encode(gzip.compress(_source().encode(), compresslevel=9, mtime=0)).decode()


@cache
def licence_notice() -> str:
    """The comment that plotly.js begins with: name, version, holder and licence."""
    comment, _, _ = _source().partition("*/")
    lines = (line.strip(" /*") for line in comment.splitlines())
    return "\n".join(line for line in lines if line)


def _source() -> str:
    return files("plotly").joinpath(*SCRIPT).read_text(encoding="utf-8")
