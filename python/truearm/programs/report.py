"""What a rewriting did, for programs that read it and for people."""

import difflib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from truearm.errors import in_json
from truearm.programs.listing import listed_target
from truearm.programs.program import Listed, Program
from truearm.programs.rewriting import Rewritten
from truearm.programs.uses import target_count

FORMAT = 1


def report_of(done: Rewritten, outputs: Sequence[Path] = ()) -> dict[str, Any]:
    """The report as JSON values; `outputs` are the files that were written."""
    return {
        "format": FORMAT,
        "language": done.program.language.name,
        "files": [str(source.path) for source in done.program.sources],
        "outputs": [str(path) for path in outputs],
        **done.facts,
        "counts": counts(done),
        "correction_mm": _spread(done.correction_mm[done.changed]),
        "correction_mrad": _spread(done.correction_mrad[done.changed]),
        "std_mm": _spread(done.std_mm[done.changed]),
        "residual_mm": _spread(done.residual_mm[done.changed]),
        "residual_mrad": _spread(done.residual_mrad[done.changed]),
        "moved_mm": _spread(done.moved_mm[done.changed]),
        "inserted": done.inserted,
        "targets": [_target(done, int(number)) for number in np.flatnonzero(done.changed)],
        "kept": [_line(done.program, one) for one in done.kept],
        "listed": [_line(done.program, one) for one in done.listed],
        "deviating": [
            {**_line(done.program, one.listed), "deviation_mm": one.deviation_mm} for one in done.deviating
        ],
        "notices": in_json(done.notices),
    }


def report_text(report: Mapping[str, Any]) -> str:
    """A report as JSON with a line for each key and each target; NaN and infinity raise ValueError."""
    lines = []
    for key, value in report.items():
        entries = [_one_line(entry) for entry in value] if isinstance(value, list) else []
        text = "[\n  " + ",\n  ".join(entries) + "\n ]" if entries else _one_line(value)
        lines.append(f" {_one_line(key)}: {text}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _one_line(value: Any) -> str:  # noqa: ANN401 - a JSON value
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def counts(done: Rewritten) -> dict[str, int]:
    """How many targets were changed, kept and left, which are all; and how much is listed.

    "listed" counts the targets that are left and, alone in "beside", places without numbers of their own,
    such as motions to what is known at run time only.
    """
    targets, changed = target_count(done.program), int(done.changed.sum())
    left = targets - changed - len(done.kept)
    return {
        "targets": targets,
        "moves": int(done.program.moves.moving.sum()),
        "changed": changed,
        "kept": len(done.kept),
        "left": left,
        "listed": len(done.listed),
        "beside": len(done.listed) - left,
    }


def table_rows(done: Rewritten, most: int) -> Iterator[tuple[str, ...]]:
    """Rows about the first `most` changed targets: place, name, shift in mm, turn in mrad, std in mm.

    And how far the position that it says moves, in mm; nothing for joint targets.
    """
    for number in np.flatnonzero(done.changed)[:most]:
        place = listed_target(done.program, int(number), "")
        yield (
            f"{done.program.sources[place.file].path.suffix[1:]}:{place.line}",
            place.name if len(place.name) <= 30 else f"{place.name[:27]}...",
            f"{done.correction_mm[number]:.3f}",
            f"{done.correction_mrad[number]:.3f}",
            f"{done.std_mm[number]:.3f}",
            "" if np.isnan(done.moved_mm[number]) else f"{done.moved_mm[number]:.3f}",
        )


def unified_diff(done: Rewritten) -> Iterator[str]:
    """The lines of a unified diff of all files, without their ends."""
    for source, content in zip(done.program.sources, done.contents, strict=True):
        before, after = (_shown(text).splitlines() for text in (source.content, content))
        name = source.path.name
        for line in _diff(before, after, name):
            yield line.rstrip("\r\n")


def _shown(content: bytes) -> str:
    """The text as people read it: UTF-8 where it is that, as any other bytes mean Latin-1."""
    try:
        return content.decode()
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _diff(before: list[str], after: list[str], name: str) -> Iterator[str]:
    """A diff that costs no more than the lines, where no line was inserted but the mark's."""
    if len(before) > 2000:
        yield from _quick_diff(before, after, name)
        return
    yield from difflib.unified_diff(before, after, name, f"{name} (compensated)", lineterm="", n=1)


def _quick_diff(before: list[str], after: list[str], name: str) -> Iterator[str]:
    """Lines that differ, one hunk each, lines inserted told apart by what follows them."""
    yield from (f"--- {name}", f"+++ {name} (compensated)")
    old, new = 0, 0
    extra = len(after) - len(before)
    while old < len(before) or new < len(after):
        if old < len(before) and new < len(after) and before[old] == after[new]:
            old, new = old + 1, new + 1
            continue
        inserted = _inserted(before, after, old, new, extra)
        yield f"@@ -{old + 1} +{new + 1} @@"
        yield from (f"+{line}" for line in after[new : new + inserted])
        new, extra = new + inserted, extra - inserted
        if inserted == 0:
            yield from (f"-{before[old]}", f"+{after[new]}")
            old, new = old + 1, new + 1


def _inserted(before: list[str], after: list[str], old: int, new: int, extra: int) -> int:
    """How many lines stand in `after` before the next one that both have, if lines were inserted here."""
    if old >= len(before):
        return len(after) - new
    for count in range(1, extra + 1):
        if new + count < len(after) and after[new + count] == before[old]:
            return count
    return 0


def _target(done: Rewritten, number: int) -> dict[str, Any]:
    place = listed_target(done.program, number, "")
    return {
        "file": place.file,
        "line": place.line,
        "column": place.column,
        "name": done.program.targets.names.get(number, ""),
        "nominal": done.nominal[number].tolist(),
        "corrected": done.corrected[number].tolist(),
        "correction_mm": float(done.correction_mm[number]),
        "correction_mrad": float(done.correction_mrad[number]),
        "std_mm": _number(done.std_mm[number]),
        "residual_mm": float(done.residual_mm[number]),
        "residual_mrad": float(done.residual_mrad[number]),
        "moved_mm": _number(done.moved_mm[number]),
        "offset_mm": _number(done.offset_mm[number]),
        "offset_mrad": _number(done.offset_mrad[number]),
    }


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _line(program: Program, one: Listed) -> dict[str, Any]:
    return {
        "file": str(program.sources[one.file].path),
        "line": one.line,
        "column": one.column,
        "name": one.name,
        "reason": one.reason,
    }


def _spread(values: Any) -> dict[str, float] | None:  # noqa: ANN401
    found = np.asarray(values, dtype=np.float64)
    found = found[np.isfinite(found)]
    if len(found) == 0:
        return None
    return {"mean": float(found.mean()), "largest": float(found.max())}
