"""One method on one cell: fitted, judged on held-out rows, timed."""

import hashlib
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.metadata import version
from typing import Any

import numpy as np

from truearm.errors import TruearmError
from truearm.fits.models import CONSTANT
from truearm.judgement.validation import Statistics
from truearm.studies.accuracy.cells import Cell
from truearm.studies.accuracy.fitted import Fitted
from truearm.studies.accuracy.libraries import one_thread
from truearm.studies.accuracy.methods import BY_NAME, Effort
from truearm.studies.accuracy.poses import Prepared, prepare
from truearm.studies.accuracy.sets import read_set
from truearm.studies.accuracy.splits import rows_of

Record = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """One method to fit to one cell.

    Attributes:
        cell: The question.
        method: Name of the method.
        quick: Whether the search of its settings is cut short.
    """

    cell: Cell
    method: str
    quick: bool = False

    @property
    def results(self) -> tuple[str, ...]:
        """Names of the results that it brings."""
        return (self.method, *BY_NAME[self.method].parts)

    def head(self, name: str) -> Record:
        """What a result is known by: everything that it depends on."""
        cell = self.cell
        return {
            "set": cell.data_set.name,
            "data": read_set(cell.data_set).print_,
            "split": cell.cut.kind,
            "detail": cell.cut.detail,
            "size": cell.size,
            "seed": cell.seed,
            "quick": self.quick,
            "method": name,
            "rows": _rows_print(cell),
        }


@lru_cache(maxsize=4096)
def _rows_print(cell: Cell) -> str:
    """Short hash of the rows that train and that are held out."""
    split = rows_of(cell.data_set, cell.cut, cell.seed, cell.poses)
    return hashlib.sha256(split.train.tobytes() + b"|" + split.holdout.tobytes()).hexdigest()[:12]


def run_job(job: Job) -> list[Record]:
    """The results of a job; a method that cannot be fitted to the rows says why in its result."""
    try:
        with one_thread():
            found = _run(job)
    except (TruearmError, np.linalg.LinAlgError) as error:
        found = [{**job.head(name), "failed": str(error)} for name in job.results]
    return [{**record, "version": version("truearm")} for record in found]


def _run(job: Job) -> list[Record]:
    prepared = _prepared(job.cell)
    _ = prepared.train_poses
    began = time.process_time()
    fitted = BY_NAME[job.method].fit(prepared, Effort(job.cell.seed, job.quick))
    seconds = prepared.fits.seconds[CONSTANT] + time.process_time() - began
    return [_record(job, name, prepared, fitted, seconds) for name in job.results]


@lru_cache(maxsize=1)
def _prepared(cell: Cell) -> Prepared:
    """What was prepared last: the methods of a cell follow each other."""
    return prepare(cell)


def _record(job: Job, name: str, prepared: Prepared, fitted: Mapping[str, Fitted], seconds: float) -> Record:
    one, held = fitted[name], prepared.held
    began = time.process_time()
    errors = one.errors(prepared, held)
    each = (time.process_time() - began) / len(held)
    found = {
        "n_train": len(prepared.train),
        "n_holdout": len(held),
        "errors": {
            f"{key}_mm": value for key, value in asdict(Statistics.of(np.linalg.norm(errors, axis=1))).items()
        },
        "coverage_95": one.coverage(prepared),
        "settings": dict(one.settings),
    }
    if name == job.method:
        found |= {"fit_s": seconds, "predict_us": 1e6 * each}
    return {**job.head(name), **found}
