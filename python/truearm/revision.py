"""What an update did to a calibration, and the calibration as it was before, byte for byte."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truearm.errors import WorkError

Floats = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Revision:
    """What an update changed.

    Attributes:
        report: What it said, JSON values.
        directions: Derivatives (5 L, u) of the identified chain's parameters by what was estimated of the
            arm: offsets of the readings, then the base's parameters where the world is known.
        covariance: Covariance (u + S, u + S) of that and of the set-ups' unknowns, SI.
        digest: SHA-256 of the file of the calibration before.
        file: The bytes of that file; None where they were left out.
    """

    report: Mapping[str, Any]
    directions: Floats
    covariance: Floats
    digest: str
    file: bytes | None

    @classmethod
    def of(cls, report: Mapping[str, Any], directions: Floats, covariance: Floats, file: bytes) -> "Revision":
        """One that keeps the bytes of the calibration before."""
        return cls(report, directions, covariance, hashlib.sha256(file).hexdigest(), file)

    def before(self, where: str) -> bytes:
        """The file of the calibration before, bit for bit.

        Args:
            where: Named in errors.

        Raises:
            WorkError: If it was left out.
        """
        if self.file is None:
            raise WorkError(
                "the calibration before the update is not in this file",
                where=where,
                rule="It was left out when the file was stripped",
                way_out=f"Look for the file with SHA-256 {self.digest}",
            )
        return self.file


def pack(revision: Revision, arrays: Arrays, *, whole: bool) -> dict[str, Any]:
    """JSON values of a revision; its arrays, and with `whole` the file before, are added to `arrays`."""
    arrays["update.directions"] = revision.directions
    arrays["update.covariance"] = revision.covariance
    if whole and revision.file is not None:
        arrays["update.before"] = np.frombuffer(revision.file, dtype=np.uint8)
    return {"report": dict(revision.report), "digest": revision.digest}


def unpack(content: Mapping[str, Any], arrays: Arrays) -> Revision:
    """The revision that `pack` described.

    Raises:
        KeyError: If an array is missing.
    """
    file = arrays.get("update.before")
    return Revision(
        content["report"],
        arrays["update.directions"],
        arrays["update.covariance"],
        content["digest"],
        None if file is None else file.tobytes(),
    )
