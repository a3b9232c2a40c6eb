"""Where the files of a rewritten program go, and writing them all or none."""

from collections.abc import Sequence
from pathlib import Path

from truearm.errors import UsageError
from truearm.files import followed, write_all


def output_paths(sources: Sequence[Path], output: str | Path) -> list[Path]:
    """The path of each file of a program: `output` for the first, the same with the others' endings for them.

    An output that is a directory, or will be one, as a slash at its end says, gets files of the same names.

    Raises:
        UsageError: If a file would be written over the program itself.
    """
    place = Path(output)
    if place.is_dir() or str(output).endswith("/"):
        paths = [place / source.name for source in sources]
    else:
        paths = [place, *(place.with_suffix(source.suffix) for source in sources[1:])]
    for path, source in zip(paths, sources, strict=True):
        if followed(path) == followed(source):
            raise UsageError(
                "the output is the program itself",
                where=str(path),
                rule="The program as it was is needed whenever the calibration is renewed",
                way_out="Name another file, or a directory",
            )
    if len(set(paths)) < len(paths):
        raise UsageError("two files of the program would get the same name", where=str(output))
    return paths


def write_outputs(paths: Sequence[Path], contents: Sequence[bytes]) -> None:
    """Write all files beside their places and then move them there, the named one last.

    Raises:
        InputError: If a directory does not exist or may not be written to; no file is written then.
    """
    write_all(reversed(list(zip(paths, contents, strict=True))))
