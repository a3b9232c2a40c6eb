"""Results over seeds: medians and worst, who is first, and by how much."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from statistics import median
from typing import Any, Final

from truearm.studies.accuracy.methods import FAMILIES, OURS
from truearm.studies.accuracy.results import Record
from truearm.studies.accuracy.running import Outcome, Study
from truearm.studies.accuracy.sets import read_set

Group = dict[str, Any]

LEVEL: Final = 1.03
"""Within this factor of the lowest error two methods count as level."""
ERRORS: Final = ("mean_mm", "rms_mm", "p95_mm", "p99_mm", "max_mm")
OTHERS: Final = ("coverage_95", "fit_s", "predict_us")
UNSTATED: Final = "not stated"
"""Version of results that do not state theirs."""


def summarise(study: Study, outcome: Outcome) -> dict[str, Any]:
    """The content of accuracy.json."""
    failed = sum("failed" in record for record in outcome.records)
    return {
        "version": version("truearm"),
        "versions": Counter(record.get("version", UNSTATED) for record in outcome.records),
        "quick": study.quick,
        "seeds": list(study.asked.seeds),
        "sizes": list(study.asked.sizes),
        "splits": list(study.asked.kinds),
        "methods": list(study.methods),
        "asked": outcome.asked,
        "there": len(outcome.records) - failed,
        "failed": failed,
        "sets": {
            one.name: {"robot": one.robot, "rows": len(read_set(one).data), "data": read_set(one).print_}
            for one in study.sets
        },
        "groups": [
            group
            for one in study.sets
            for kind in study.asked.kinds
            for size in study.asked.sizes
            if (group := _group(study, outcome.records, (one.name, kind, size))) is not None
        ],
        "results": outcome.records,
    }


def _group(study: Study, records: Sequence[Record], where: tuple[str, str, str]) -> Group | None:
    """Statistics of one set, split and size over the runs of which all methods have a result."""
    runs: dict[tuple[int, str], dict[str, Record]] = {}
    for record in records:
        if (record["set"], record["split"], record["size"]) == where:
            runs.setdefault((record["seed"], record["detail"]), {})[record["method"]] = record
    whole = [run for run in runs.values() if all(name in run for name in study.methods)]
    if not whole:
        return None
    names = [name for name in FAMILIES if name in whole[0]]
    methods = {name: _statistics([run[name] for run in whole]) for name in names}
    return {
        **dict(zip(("set", "split", "size"), where, strict=True)),
        "runs": len(whole),
        "seeds": len({seed for (seed, _), run in runs.items() if run in whole}),
        "n_train": max(record.get("n_train", 0) for run in whole for record in run.values()),
        "n_holdout": min(
            (record["n_holdout"] for run in whole for record in _fitted(run.values())), default=0
        ),
        "methods": methods,
        "lead": _lead(whole),
    }


def _fitted(records: Iterable[Record]) -> list[Record]:
    return [record for record in records if "failed" not in record]


def _statistics(records: Sequence[Record]) -> dict[str, Any]:
    """Medians over the runs that a method could be fitted to, how many they are, and the worst mean."""
    fitted = _fitted(records)
    found: dict[str, Any] = {"failed": len(records) - len(fitted), "runs": len(fitted)}
    if not fitted:
        return found
    for key in ERRORS:
        found[key] = median(record["errors"][key] for record in fitted)
    found["worst_mean_mm"] = max(record["errors"]["mean_mm"] for record in fitted)
    for key in OTHERS:
        values = [record[key] for record in fitted if record.get(key) is not None]
        found[key] = median(values) if values else None
    return found


def _lead(runs: Sequence[Mapping[str, Record]]) -> dict[str, Any] | None:
    """Ours against the best of the others, and against the best that is no curve of single joints.

    Each of them is compared over the runs that ours and it could be fitted to; the best is the one that ours
    has the highest ratio to.
    """
    names = [name for name in FAMILIES if name in runs[0] and FAMILIES[name] not in ("ours", "block")]
    found = {name: pair for name in names if (pair := _both(runs, name)) is not None}
    if not found:
        return None
    best = max(found, key=lambda name: found[name]["ratio"])
    plain = [name for name in found if FAMILIES[name] != "curves"] or list(found)
    uncurved = max(plain, key=lambda name: found[name]["ratio"])
    return {
        "best": best,
        **found[best],
        "level": found[best]["ratio"] <= LEVEL,
        "best_without_curves": uncurved,
        "ratio_without_curves": found[uncurved]["ratio"],
        "runs_without_curves": found[uncurved]["runs"],
    }


def _both(runs: Sequence[Mapping[str, Record]], name: str) -> dict[str, Any] | None:
    """Medians of ours and another over the runs that both could be fitted to; None without any."""
    pairs = [(run[OURS], run[name]) for run in runs if OURS in run]
    shared = [pair for pair in pairs if len(_fitted(pair)) == len(pair)]
    if not shared:
        return None
    ours, other = (
        median(record["errors"]["mean_mm"] for record in side) for side in zip(*shared, strict=True)
    )
    return {"runs": len(shared), "ours_mm": ours, "best_mm": other, "ratio": ours / other}
