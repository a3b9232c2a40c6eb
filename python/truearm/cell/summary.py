"""What a session holds, in numbers."""

from typing import Any

from truearm.cell.checks import unchecked_poses
from truearm.cell.session import Session


def summary_of(session: Session) -> dict[str, Any]:
    """JSON values: poses, measured, skipped, open, readings and how many failed, frame, stretches, events.

    "complete" says whether no step is open, neither pose nor check. Beside them how many checks were measured
    and skipped, and the poses of which nothing says whether something moved meanwhile.
    """
    counts = {
        (kind, outcome): count
        for kind, outcome, count in session.rows(
            "SELECT kind, coalesce(outcome, 'open'), count(*) FROM steps LEFT JOIN outcomes USING (step) "
            "GROUP BY 1, 2"
        )
    }
    readings, invalid = session.rows("SELECT count(*), coalesce(sum(1 - valid), 0) FROM readings")[0]
    registration = session.rows("SELECT residual_mm, poses FROM registration")
    stretches = session.rows("SELECT measured, model, mean_mm, p95_mm, expected_mm FROM stretches ORDER BY 1")
    skipped = session.rows(
        "SELECT pose, reason FROM outcomes JOIN steps USING (step) "
        "WHERE kind = 'pose' AND outcome = 'skipped'"
    )
    events = session.rows("SELECT kind, count(*) FROM events GROUP BY 1 ORDER BY 1")
    return {
        "cell": session.meta("cell"),
        "arm": session.meta("arm")["name"],
        "poses": sum(count for (kind, _), count in counts.items() if kind == "pose"),
        "measured": counts.get(("pose", "measured"), 0),
        "open": counts.get(("pose", "open"), 0),
        "complete": not any(outcome == "open" for _, outcome in counts),
        "skipped": [{"pose": pose + 1, "reason": reason} for pose, reason in skipped],
        "checks": {outcome: counts.get(("check", outcome), 0) for outcome in ("measured", "skipped")},
        "unchecked": unchecked_poses(session),
        "readings": readings,
        "invalid_readings": invalid,
        "registration": None
        if not registration
        else {"residual_mm": registration[0][0], "contacts": registration[0][1]},
        "stretches": [
            dict(zip(("measured", "model", "mean_mm", "p95_mm", "expected_mm"), row, strict=True))
            for row in stretches
        ],
        "events": dict(events),
        "last_event": next(
            (row[0] for row in session.rows("SELECT message FROM events ORDER BY id DESC LIMIT 1")), None
        ),
    }
