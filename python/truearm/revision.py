"""What an update did to a calibration, and the calibration as it was before, byte for byte."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import WorkError, count_of
from truearm.types import Floats

Arrays = dict[str, NDArray[Any]]


CARRIED: Final = ("response", "own", "inputs", "jacobian", "setup", "tied")


@dataclass(frozen=True, eq=False)
class Carried:
    """What an update made of the errors that the calibration had before it.

    They show in its n rows of m values, `e = jacobian * arm + setup * set-ups`, and what was estimated took
    them up: it is off by `own - response * e`. New set-ups are off by what those that they are tied to were
    off before, beside that.

    Attributes:
        response: How the u unknowns of the arm and the S of set-ups follow what rows show (u + S, n m).
        own: Covariance (u + S, u + S) that they would have had nothing been uncertain before, SI.
        inputs: Of the field at the rows (n, I).
        jacobian: Derivatives (n, m, 5 L) of what rows show by the chain's parameters.
        setup: The same (n, m, S') by the set-ups of the calibration before, as far as they are tied.
        tied: One where an unknown of the new set-ups is tied to one of those before (S, S'), else zero.
    """

    response: Floats
    own: Floats
    inputs: Floats
    jacobian: Floats
    setup: Floats
    tied: Floats

    def __repr__(self) -> str:
        unknowns, shown = self.response.shape
        return f"<Carried: {count_of(unknowns, 'unknown')}, {count_of(shown, 'value')} of rows>"


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
        carried: What became of the errors before, which a field's posterior is added to; None where there is
            no field, where it was left out, or in files of earlier versions.
    """

    report: Mapping[str, Any]
    directions: Floats
    covariance: Floats
    digest: str
    file: bytes | None
    carried: Carried | None = None

    def __repr__(self) -> str:
        kept = "left out" if self.file is None else "kept"
        return f"<Revision: {self.report['verdict']}, the calibration before is {kept}>"

    @classmethod
    def of(cls, report: Mapping[str, Any], directions: Floats, covariance: Floats, file: bytes) -> "Revision":
        """One that keeps the bytes of the calibration before."""
        return cls(report, directions, covariance, hashlib.sha256(file).hexdigest(), file)

    def stripped(self) -> "Revision":
        """The same without the calibration before, and what only goes with it."""
        return replace(self, file=None, carried=None)

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
    if whole and revision.carried is not None:
        arrays.update({f"update.{name}": getattr(revision.carried, name) for name in CARRIED})
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
        Carried(*(arrays[f"update.{name}"] for name in CARRIED)) if "update.response" in arrays else None,
    )
