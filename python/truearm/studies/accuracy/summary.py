"""Results over seeds: medians and worst, who is first, and by how much."""

from collections.abc import Mapping, Sequence
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


def summarise(study: Study, outcome: Outcome) -> dict[str, Any]:
    """The content of accuracy.json."""
    return {
        "version": version("truearm"),
        "quick": study.quick,
        "seeds": list(study.asked.seeds),
        "sizes": list(study.asked.sizes),
        "splits": list(study.asked.kinds),
        "methods": list(study.methods),
        "asked": outcome.asked,
        "there": len(outcome.records),
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
    """Statistics of one set, split and size over the runs that all methods have; None without any."""
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
        "methods": methods,
        "lead": _lead(methods),
    }


def _statistics(records: Sequence[Record]) -> dict[str, Any]:
    """Medians over runs, and the worst mean; a method that could not be fitted has none for that run."""
    fitted = [record for record in records if "failed" not in record]
    found: dict[str, Any] = {"failed": len(records) - len(fitted)}
    if not fitted:
        return found
    for key in ERRORS:
        found[key] = median(record["errors"][key] for record in fitted)
    found["worst_mean_mm"] = max(record["errors"]["mean_mm"] for record in fitted)
    for key in OTHERS:
        values = [record[key] for record in fitted if record.get(key) is not None]
        found[key] = median(values) if values else None
    return found


def _lead(methods: Mapping[str, Mapping[str, Any]]) -> dict[str, Any] | None:
    """Ours against the best of the others, and against the best that is no curve of single joints."""
    ours = methods.get(OURS, {}).get("mean_mm")
    others = {
        name: found["mean_mm"]
        for name, found in methods.items()
        if FAMILIES[name] not in ("ours", "block") and "mean_mm" in found
    }
    if ours is None or not others:
        return None
    best = min(others, key=lambda name: others[name])
    plain = {name: mean for name, mean in others.items() if FAMILIES[name] != "curves"}
    uncurved = min(plain or others, key=lambda name: others[name])
    return {
        "best": best,
        "ratio": ours / others[best],
        "level": ours <= LEVEL * others[best],
        "best_without_curves": uncurved,
        "ratio_without_curves": ours / others[uncurved],
    }
