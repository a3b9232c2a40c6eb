"""Calibration files taken apart and put together again."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from truearm.storage.calibration_file import Arrays, calibration_bytes, parse_calibration


def read_calibration_file(path: Path) -> tuple[Arrays, dict[str, Any]]:
    return parse_calibration(path.read_bytes(), str(path))


def write_calibration_file(path: Path, arrays: Arrays, content: Mapping[str, Any]) -> None:
    path.write_bytes(calibration_bytes(arrays, content))
