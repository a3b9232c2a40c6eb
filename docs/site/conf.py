"""How Sphinx makes the site of the pages, which know nothing of it: `make site`."""

import re
import shutil

from sphinx.application import Sphinx

project = "truearm"
author = "the truearm developers"
extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
root_doc = "README"
exclude_patterns = ["site", "**.py"]
html_theme = "furo"
html_title = "truearm"
myst_heading_anchors = 6
myst_enable_extensions = ["dollarmath"]
suppress_warnings = ["misc.highlighting_failure"]

PAGE_LINK = re.compile(r"\]\((?!\w+:)([^)#\s]+)\.md(?:#[^)]*)?\)")


def add_contents(_app: Sphinx, page: str, source: list[str]) -> None:
    """Pages that an index links are below it, in its order."""
    if page != root_doc and not page.endswith("/README"):
        return
    linked = dict.fromkeys(link for link in PAGE_LINK.findall(source[0]) if not link.startswith(".."))
    source[0] += "\n\n```{toctree}\n:hidden:\n\n" + "\n".join(linked) + "\n```\n"


def copy_root(app: Sphinx, error: Exception | None) -> None:
    """A web server shows index.html first."""
    if error is None:
        shutil.copy(app.outdir / f"{root_doc}.html", app.outdir / "index.html")


def setup(app: Sphinx) -> None:
    """What Sphinx calls first."""
    app.connect("source-read", add_contents)
    app.connect("build-finished", copy_root)
