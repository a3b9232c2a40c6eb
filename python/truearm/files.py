"""Reading and writing whole files, with errors that name the file and the way out."""

import os
import secrets
import stat
import tempfile
import tomllib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from truearm.errors import InputError, UsageError

# Windows takes a descriptor for one of text, and turns ends of lines, unless told.
NEW_FILE: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
OPEN_HERE: Final = frozenset({Path("/dev/stdout"), Path("/dev/stderr")})
"""Names of what this process has open, whatever that is."""
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
MOSTLY: Final = 0.8
"""Share of zeros among every second byte from which text is UTF-16: characters of Europe have one each."""
LOOKED_AT: Final = 4096
"""Bytes of a file, an even number, that tell how it is written."""
ZIP = b"PK\x03\x04"
_SIGNATURES = (
    (ZIP, "a ZIP archive, such as an Excel workbook"),
    (b"\xd0\xcf\x11\xe0", "an old Office document"),
    (b"%PDF", "a PDF"),
    (b"SQLite format 3\x00", "an SQLite database"),
    (b"\x89PNG", "an image"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\x89HDF", "an HDF5 file"),
)


def as_path(given: object) -> Path:
    """`given`, a text or a path that names a file, as a path.

    Raises:
        UsageError: If it is anything else.
    """
    if isinstance(given, str | os.PathLike):
        return Path(given)
    raise UsageError(f"the file is of type {type(given).__name__}", rule="A path is needed, as text or Path")


def name_in_text(name: str) -> str:
    """The name of a file as UTF-8 text can hold it: bytes of it that are none stand as U+FFFD."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def read_bytes(path: Path) -> bytes:
    """The content of a file or of a pipe.

    Raises:
        InputError: If there is no such file, it is a directory or a device (a terminal, too, or one without
            an end), or it cannot or may not be read.
    """
    try:
        if path.is_char_device() or path.is_block_device():
            raise InputError("this is a device", where=str(path), rule="A file or a pipe is needed")
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError("there is no such file", where=str(path)) from None
    except IsADirectoryError:
        raise InputError("this is a directory", where=str(path), rule="A file is needed") from None
    except PermissionError:
        raise InputError("no permission to read this file", where=str(path)) from None
    except OSError as error:
        raise InputError(f"this cannot be read: {_reason(error)}", where=str(path)) from None


def is_file(path: Path) -> bool:
    """Whether there is a file at `path`; none has a name that is too long for one."""
    try:
        return path.is_file()
    except OSError:
        return False


def existing(given: object) -> Path:
    """The path of a file that is there, as `as_path`.

    Raises:
        InputError: As :func:`read_bytes`, if there is none.
    """
    path = as_path(given)
    if not is_file(path) and not path.is_fifo():
        read_bytes(path)
    return path


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, with or without byte order mark.

    Raises:
        InputError: As for :func:`read_bytes`, and if the file is not text in UTF-8.
    """
    return decode_text(read_bytes(path), where=str(path))


def decode_text(content: bytes, *, where: str, way_out: str = "Save it as UTF-8") -> str:
    """`content` as UTF-8 text; `way_out` is said of text in another encoding.

    Raises:
        InputError: If it is not text; says what it is where that can be told from its first bytes.
    """
    for signature, kind in _SIGNATURES:
        if content.startswith(signature):
            raise InputError(f"this is {kind}, not text", where=where, way_out="Export it as text")
    if encoding := utf_16_of(content):
        unmarked = "" if encoding == "utf-16" else ", without a byte order mark"
        raise InputError(f"this is UTF-16 text{unmarked}", where=where, way_out=way_out)
    if b"\x00" in content:
        raise InputError(
            "this is binary data, not text", where=where, way_out="Export it as text, a table as CSV"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"line {line} holds bytes that are not UTF-8", where=where, way_out=way_out
        ) from None


def utf_16_of(content: bytes) -> str:
    """Which UTF-16 a content is, by its byte order mark or its zeros, as Python calls it; "" if none."""
    if content.startswith(UTF_16):
        return "utf-16"
    even, odd = content[:LOOKED_AT:2], content[1:LOOKED_AT:2]
    for encoding, high, low in (("utf-16-le", odd, even), ("utf-16-be", even, odd)):
        if high.count(0) > MOSTLY * len(high) and 0 not in low:
            return encoding
    return ""


def parsed(text: str, *, where: str) -> dict[str, Any]:
    """The values of a TOML text.

    Raises:
        InputError: If it is none.
        UsageError: If it is no text.
    """
    if not isinstance(text, str):
        raise UsageError(f"the text is of type {type(text).__name__}", where=where, rule="TOML is a text")
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"not TOML: {error}", where=where) from None


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file completely or not at all, as :func:`write_all`."""
    write_all([(path, content)])


def remove(path: Path) -> None:
    """Take a file away, if there is one.

    Raises:
        InputError: If it cannot be.
    """
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"this cannot be replaced: {_reason(error)}", where=str(path)) from None


def write_all(contents: Iterable[tuple[Path, str | bytes]]) -> None:
    """Write files, each completely or not at all: neighbours of all are written, then renamed in this order.

    What is renamed is on the disk, so that after a loss of power each file is the old one or the new one. A
    link is followed, and a file that is replaced keeps its permissions. What is no file, such as a pipe or
    /dev/stdout, is written to at the end and not replaced. Text is written as UTF-8; bytes of names of files
    that are none are escaped, as in JSON.

    Raises:
        InputError: If a directory does not exist or may not be written to, or is what a path names, or a
            file cannot be written. Nothing is written then, unless a rename or a stream fails behind others.
    """
    streams: list[tuple[Path, bytes]] = []
    neighbours: list[tuple[Path, Path]] = []
    path = Path()
    try:
        for path, content in contents:
            data = content.encode(errors="backslashreplace") if isinstance(content, str) else content
            if _is_stream(path):
                streams.append((path, data))
            else:
                place = followed(path) if path.is_symlink() else path
                neighbours.append((_beside(place, data), place))
        for neighbour, path in neighbours:
            neighbour.replace(path)
    except BaseException as error:
        for neighbour, _ in neighbours:
            neighbour.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"this cannot be written: {_reason(error)}", where=str(path)) from None
        raise
    for path, data in streams:
        _write_stream(path, data)


def _write_stream(path: Path, data: bytes) -> None:
    try:
        with path.open("ab") as stream:
            stream.write(data)
    except OSError as error:
        raise InputError(f"this cannot be written: {_reason(error)}", where=str(path)) from None


def make_directory(path: Path) -> None:
    """Make a directory, and those above it, where there is none.

    Raises:
        InputError: If a file is in its place or above it, or it cannot or may not be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise InputError("a file is in the way", where=str(path), rule="A directory is needed") from None
    except OSError as error:
        raise InputError(f"this directory cannot be made: {_reason(error)}", where=str(path)) from None


def followed(path: Path) -> Path:
    """Where a path leads to: links are followed.

    Raises:
        InputError: If links lead to themselves.
    """
    with suppress(OSError, RuntimeError):
        found = path.resolve()
        if not os.path.islink(found):  # noqa: PTH114 - without permission to look it is none
            return found  # from Python 3.13 on of a link that leads to itself as well
    raise InputError("this link leads to itself", where=str(path))


def _is_stream(path: Path) -> bool:
    """Whether a path is a pipe, a device, or a name of what this process has open, which are written to."""
    own = path in OPEN_HERE or path.parts[:3] in {("/", "dev", "fd"), ("/", "proc", "self")}
    return own or (path.exists() and not path.is_dir() and not path.is_file())


def check_place(path: Path) -> None:
    """Check before long work that a file may come to a place; streams and links are as write_all has them.

    Raises:
        InputError: If a directory is there, or there is none for it that takes files.
    """
    if _is_stream(path):
        return
    if path.is_dir():
        raise InputError("this is a directory", where=str(path), rule="A file is to be written")
    path = followed(path) if path.is_symlink() else path
    if path.parent.exists() and not path.parent.is_dir():
        raise InputError("this is a file", where=str(path.parent), rule="A directory is needed")
    if not path.parent.exists():
        raise InputError("there is no such directory", where=str(path.parent))
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError("no permission to write here", where=str(path.parent))


def check_output(output: Path, *inputs: Path | str | None) -> None:
    """Check before long work that a file may be written: as check_place, and as refuse_own_input.

    Raises:
        InputError: If it cannot come there.
        UsageError: If it is one of the inputs.
    """
    check_place(output)
    if not _is_stream(output):
        check_takes_files((followed(output) if output.is_symlink() else output).parent)
    refuse_own_input(output, *inputs)


def check_takes_files(directory: Path) -> None:
    """Check before long work, by trying, that something can be made in a directory: permissions do not tell.

    Raises:
        InputError: If nothing can.
    """
    try:
        Path(tempfile.mkdtemp(prefix=".", dir=directory)).rmdir()
    except OSError as error:
        raise InputError(f"nothing can be written here: {_reason(error)}", where=str(directory)) from None


def _beside(path: Path, data: bytes) -> Path:
    """A neighbour of a file that holds what is to come into it."""
    check_place(path)
    neighbour = path.with_name(f".{secrets.token_hex(8)}")
    mode = stat.S_IMODE(path.stat().st_mode) if path.exists() else None
    try:
        handle = os.open(neighbour, NEW_FILE, 0o666 if mode is None else 0o600)
    except PermissionError:
        raise InputError("no permission to write here", where=str(path.parent)) from None
    try:
        with os.fdopen(handle, "wb") as file:
            if mode is not None:
                neighbour.chmod(mode)
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
    except BaseException:
        neighbour.unlink(missing_ok=True)
        raise
    return neighbour


def refuse_own_input(output: Path, *inputs: Path | str | None) -> None:
    """Refuse to write over a file that the same work reads.

    Args:
        output: What is to be written.
        inputs: What is read; a text is what names a robot or a controller, a file with or without the tip
            link behind a "#", or no file.

    Raises:
        UsageError: If the output is one of the inputs, under whatever name.
    """
    for given in inputs:
        if given is not None and output.exists() and any(map(output.samefile, _files_of(given))):
            raise UsageError(
                f"{output} is what is read",
                rule="An input is never written over",
                way_out="Name another file",
            )


def _files_of(given: Path | str) -> list[Path]:
    """The files that an argument may mean."""
    named = [Path(given), *([Path(given.partition("#")[0])] if isinstance(given, str) else [])]
    return [path for path in named if is_file(path)]


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def refuse_same(output: Path, other: Path | None, *, option: str) -> None:
    """Refuse to write two things into one file.

    Args:
        output: Where the one goes.
        other: Where the other goes, if there is one.
        option: Option that names the other, for messages.

    Raises:
        UsageError: If both are the same.
    """
    if other is not None and followed(other) == followed(output):
        raise UsageError(f"{other} is the output already", where=option, way_out="Name another file")
