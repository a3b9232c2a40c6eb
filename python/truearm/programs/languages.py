"""The languages, and which one a file is written in."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from truearm.errors import UsageError, list_names
from truearm.programs.csv_path import CsvPath
from truearm.programs.krl import KRL
from truearm.programs.melfa import MelfaBasic
from truearm.programs.program import Language
from truearm.programs.rapid import RAPID
from truearm.programs.tp import FanucTp
from truearm.programs.urscript import UrScript

LANGUAGES: Final[tuple[Language, ...]] = (
    KRL(),
    RAPID(),
    FanucTp(),
    UrScript(),
    MelfaBasic(),
    CsvPath(),
)


def language_of(path: Path, name: str | None = None, known: Sequence[Language] = LANGUAGES) -> Language:
    """The language of a file by its ending, or by `name`.

    Raises:
        UsageError: If there is no such language, or the ending belongs to none or to several.
    """
    if name is not None:
        found = [one for one in known if one.name.casefold() == name.casefold()]
    else:
        found = [one for one in known if path.suffix.lower() in one.endings]
    if len(found) == 1:
        return found[0]
    asked = f'language "{name}"' if name is not None else f'the ending "{path.suffix}"'
    raise UsageError(
        f"{asked} belongs to more than one language" if found else f"{asked} is not known",
        where=str(path),
        rule=f"Languages are {list_names(one.name for one in known)}",
        way_out="Name one with --language",
    )
