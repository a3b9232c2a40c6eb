"""What a session holds, in numbers."""

from typing import Any

from truearm.cell.checks import unchecked_poses
from truearm.cell.session import Session
from truearm.errors import Notice, list_rows


def summary_of(session: Session) -> dict[str, Any]:
    """JSON values: poses, measured, skipped, open, readings and how many failed, frame, stretches, events.

    "complete" says whether no step is open, neither pose nor check. Beside them how many checks were measured
    and skipped, and the poses of which nothing says whether something moved meanwhile. What was skipped,
    poses, contacts for the frame and checks, is listed with the pose, from 1, and the reason.
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
    skipped = {kind: _skipped(session, kind) for kind in ("pose", "registration", "check")}
    events = session.rows("SELECT kind, count(*) FROM events GROUP BY 1 ORDER BY 1")
    return {
        "cell": session.meta("cell"),
        "arm": session.arm["name"],
        "poses": sum(count for (kind, _), count in counts.items() if kind == "pose"),
        "measured": counts.get(("pose", "measured"), 0),
        "open": counts.get(("pose", "open"), 0),
        "complete": not any(outcome == "open" for _, outcome in counts),
        "skipped": skipped["pose"],
        "skipped_contacts": skipped["registration"],
        "skipped_checks": skipped["check"],
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


def told_skipped(found: dict[str, Any]) -> list[Notice]:
    """What is to be known of poses that a summary says were skipped, if there are any."""
    poses = [each["pose"] for each in found["skipped"]]
    if not poses:
        return []
    return [
        Notice(
            "skipped",
            f"{len(poses)} of {found['poses']} poses were skipped ({list_rows(poses, 'pose')}): truearm "
            "session show tells why. To measure them, give them as a list of their own and a new session.",
        )
    ]


def _skipped(session: Session, kind: str) -> list[dict[str, Any]]:
    """Pose, from 1, and reason of each step of a kind that was skipped."""
    query = (
        "SELECT pose, reason FROM outcomes JOIN steps USING (step) "
        "WHERE kind = ? AND outcome = 'skipped' ORDER BY step"
    )
    return [{"pose": pose + 1, "reason": reason} for pose, reason in session.rows(query, (kind,))]
