"""The container of a calibration: safetensors with arrays, one JSON text, and a digest over every byte.

The header of a safetensors file is JSON; its metadata holds one text, "truearm", and this begins with the
version of the layout and the digest: SHA-256 over the whole file with the digest's own 64 digits as zeros.
"""

import hashlib
import json
import math
import os
import re
import stat
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from truearm.errors import InputError
from truearm.files import read_bytes

SCHEMA: Final = 1
METADATA_KEY: Final = "truearm"
NO_DIGEST: Final = "0" * 64
DIGEST: Final = re.compile(rb'\\"sha256\\":\\"([0-9a-f]{64})\\"')
LENGTH_BYTES: Final = 8
FIRST_BYTES: Final = LENGTH_BYTES + 1
LONGEST_HEADER: Final = 100_000_000
NOT_OURS: Final = "A calibration is written by: truearm calibrate"
AGAIN: Final = "Copy it again from where it was written, or calibrate again"

Arrays = dict[str, NDArray[Any]]


def calibration_bytes(arrays: Arrays, content: Mapping[str, Any]) -> bytes:
    """What a file of arrays and JSON values holds."""
    text = json.dumps(
        {"schema": SCHEMA, "sha256": NO_DIGEST, **content}, allow_nan=False, separators=(",", ":")
    )
    contiguous = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    data = save(contiguous, {METADATA_KEY: text})
    before, _, behind = data.partition(NO_DIGEST.encode())
    return before + hashlib.sha256(data).hexdigest().encode() + behind


def parse_calibration(data: bytes, where: str) -> tuple[Arrays, dict[str, Any]]:
    """Arrays and JSON values of a file's content.

    Args:
        data: The content.
        where: Named in errors.

    Raises:
        InputError: If it is none of ours, is cut short or altered in any byte, or has a layout that this
            version does not know.
    """
    header = _header(data, where)
    content = _content(header, where)
    _check_schema(content, where)
    _check_whole(data, header, where)
    _check_digest(data, where)
    try:
        arrays = load(data)
    except SafetensorError as error:
        raise _altered(where, str(error)) from None
    return arrays, content


def read_calibration(path: Path) -> bytes:
    """The content of a file, if its first bytes are those of a calibration.

    What it is is looked up before it is opened: opening a pipe waits for its other end.

    Raises:
        InputError: If there is no such file, it cannot be read, is none of ours or is cut short.
    """
    with suppress(OSError):
        kind = path.stat().st_mode
        if stat.S_ISREG(kind):
            with path.open("rb") as file:
                _check_first(file.read(FIRST_BYTES), os.fstat(file.fileno()).st_size, str(path))
        elif not stat.S_ISDIR(kind):
            raise InputError(
                "this is a pipe or a device",
                where=str(path),
                rule="A regular file is needed",
                way_out="Copy the calibration into one",
            )
    return read_bytes(path)


def _check_first(first: bytes, size: int, where: str) -> int:
    """The length of the header of a file of `size` bytes, by its first ones."""
    length = int.from_bytes(first[:LENGTH_BYTES], "little")
    if length > LONGEST_HEADER or first[LENGTH_BYTES:FIRST_BYTES] != b"{":
        raise _not_ours(where, "this is no calibration file" if first else "this is an empty file")
    if size < LENGTH_BYTES + length:
        raise _cut_short(where, size, LENGTH_BYTES + length)
    return length


def _header(data: bytes, where: str) -> dict[str, Any]:
    """The header of a safetensors file."""
    size = _check_first(data[:FIRST_BYTES], len(data), where)
    try:
        header = json.loads(data[LENGTH_BYTES : LENGTH_BYTES + size])
    except (ValueError, RecursionError):
        raise _altered(where, "its header is no JSON") from None
    if not isinstance(header, dict):
        raise _not_ours(where, "this is no calibration file")
    return header


def _content(header: dict[str, Any], where: str) -> dict[str, Any]:
    """Our JSON values."""
    metadata = header.get("__metadata__")
    text = metadata.get(METADATA_KEY) if isinstance(metadata, dict) else None
    if not isinstance(text, str):
        raise _not_ours(where, "this is a safetensors file, but no calibration")
    try:
        content = json.loads(text, parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError):
        raise _altered(where, "its metadata is no JSON") from None
    if not isinstance(content, dict):
        raise _altered(where, "its metadata is no JSON object")
    return content


def _finite(text: str) -> float:
    """A number of the text; ValueError where it is none, or beyond all that a float holds."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def _check_schema(content: dict[str, Any], where: str) -> None:
    schema = content.get("schema")
    if schema != SCHEMA:
        raise InputError(
            f"the layout of this calibration has version {schema}",
            where=where,
            rule=f"This version of truearm reads version {SCHEMA}",
            way_out=f"It was written by truearm {content.get('version', 'of an unknown version')}: use that "
            "version, or calibrate again with this one",
        )


def _check_whole(data: bytes, header: dict[str, Any], where: str) -> None:
    ends = [0]
    for name, entry in header.items():
        if name != "__metadata__":
            try:
                ends.append(int(entry["data_offsets"][1]))
            except (TypeError, KeyError, IndexError, ValueError):
                raise _altered(where, f'the entry of the array "{name}" cannot be read') from None
    needed = LENGTH_BYTES + int.from_bytes(data[:LENGTH_BYTES], "little") + max(ends)
    if len(data) < needed:
        raise _cut_short(where, len(data), needed)


def _check_digest(data: bytes, where: str) -> None:
    place = DIGEST.search(data)
    if place is None:
        raise _altered(where, "it holds no digest")
    blank = data[: place.start(1)] + NO_DIGEST.encode() + data[place.end(1) :]
    if hashlib.sha256(blank).hexdigest().encode() != place[1]:
        raise _altered(where, "its content does not agree with its SHA-256 digest")


def _not_ours(where: str, what: str) -> InputError:
    return InputError(what, where=where, rule=NOT_OURS)


def _altered(where: str, how: str) -> InputError:
    return InputError(f"this calibration has been altered: {how}", where=where, way_out=AGAIN)


def _cut_short(where: str, size: int, needed: int) -> InputError:
    return InputError(
        f"this calibration is cut short: {size} of {needed} bytes are there", where=where, way_out=AGAIN
    )
