"""The library of arms: robot files that come with truearm, found by name."""

from importlib import resources
from importlib.resources.abc import Traversable

from truearm.errors import InputError, list_names, nearest


def library_names() -> list[str]:
    """Names of all arms in the library, sorted."""
    return sorted(_files())


def library_text(name: str) -> tuple[str, str]:
    """Name and text of the robot file of an arm; case and the separators -, _ and blank are ignored.

    Raises:
        InputError: If there is no such arm; names the most similar ones.
    """
    by_folded = {_fold(known): known for known in _files()}
    known = by_folded.get(_fold(name))
    if known is None:
        near = nearest(name, library_names())
        raise InputError(
            f'there is no robot "{name}" in the library and no file of that name',
            rule=f"Did you mean {list_names(near, last='or')}?" if near else "",
            way_out="List the library with: truearm robots",
        )
    return known, _files()[known].read_text(encoding="utf-8")


def _fold(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter not in "-_ .")


def _files() -> dict[str, Traversable]:
    folder = resources.files("truearm") / "robots"
    return {
        entry.name.removesuffix(".toml"): entry for entry in folder.iterdir() if entry.name.endswith(".toml")
    }
