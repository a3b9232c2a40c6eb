"""The accepted measurements of a session, as a table and as Measurements."""

import json
import math
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pandas as pd

from truearm.cell.checks import unsure_steps
from truearm.cell.poses_file import GROUP
from truearm.cell.scatter import sigma_of_mean_m, weighted_mean
from truearm.cell.session import Session
from truearm.cell.session_checks import PUT_BACK
from truearm.errors import InputError
from truearm.measurements import Measurements
from truearm.tables.columns import APPROACH, POSE, PURPOSE, READINGS
from truearm.types import Floats

QUERY = """
SELECT o.step, o.pose, o.purpose, o.approach, o.attempts, o.time_s,
       r.attempt, r.joints, r.x_m, r.y_m, r.z_m, r.qw, r.qx, r.qy, r.qz, r.sigma_m, r.temperature_c,
       r.features
FROM (SELECT * FROM outcomes JOIN steps USING (step)
      WHERE outcome = 'measured' AND kind = ? ORDER BY step LIMIT ?) o
JOIN readings r USING (step)
WHERE r.valid ORDER BY o.step, r.attempt
"""
COLUMNS = (
    "step", "pose", "purpose", "approach", "attempts", "time_s", "attempt", "joints", "x", "y", "z",
    "qw", "qx", "qy", "qz", "sigma", "temperature_c", "features",
)  # fmt: skip
TURN = ["qw", "qx", "qy", "qz"]


def accepted_table(session: Session, kind: str = "pose", *, most: int | None = None) -> pd.DataFrame:
    """A row for each measured step: the mean of its accepted readings, weighted by 1/sigma^2, in rad and m.

    Columns: pose (from 1, in the list of poses), q1 ... qN, x, y, z, sigma, qw ... qz where orientation was
    measured, approach, readings (how many were accepted), temperature_c where there is one, other features.
    Orientation, temperature and features are means of those readings that have them, the last two plain.
    Where there are purposes, purpose too. sigma is that of the mean.

    Poses also have a group where the list of poses gave one, and where something moved: those between a check
    that found the cell in its place and one that did not are a set-up of their own. What the list does not
    name is called after the session.

    Args:
        session: The session.
        kind: "pose", "registration" or "check".
        most: Only so many steps, from the first.
    """
    grouped: dict[int, list[dict[str, Any]]] = {}
    for values in session.rows(QUERY, (kind, -1 if most is None else most)):
        row = dict(zip(COLUMNS, values, strict=True))
        if row["attempt"] in json.loads(row["attempts"]):
            grouped.setdefault(row["step"], []).append(row)
    table = pd.DataFrame([_merged(rows) for rows in grouped.values()])
    if kind == "pose" and not table.empty:
        table = _with_group(table, session)
    return table


def exported(table: pd.DataFrame) -> str:
    """The text of an accepted table as a file of measurements."""
    return table.drop(columns="step").to_csv(index=False, lineterminator="\n")


def measurements_of(session: Session, *, most: int | None = None, where: str = "session") -> Measurements:
    """The accepted poses as Measurements of one set-up: without those while something moved."""
    table = accepted_table(session, most=most)
    in_place = table[~table["pose"].isin(moved_poses(session, table))]
    return Measurements.from_dataframe(in_place.drop(columns=["step", "pose"]), name=where)


def moved_poses(session: Session, table: pd.DataFrame) -> list[int]:
    """Poses of an accepted table, from 1, that were measured while something moved: see unsure_steps."""
    moved = [step for steps in unsure_steps(session) for step in steps]
    return [] if table.empty else table["pose"][table["step"].isin(moved)].tolist()


def points_and_joints(session: Session, kind: str) -> tuple[list[int], Floats, Floats]:
    """Steps, joints (n, N) and points (n, 3) of the measured steps of a kind."""
    table = accepted_table(session, kind)
    if table.empty:
        return [], np.empty((0, 0)), np.empty((0, 3))
    joints = table[[name for name in table.columns if name.startswith("q") and name[1:].isdigit()]]
    return table["step"].tolist(), joints.to_numpy(), table[["x", "y", "z"]].to_numpy()


def _merged(rows: list[dict[str, Any]]) -> dict[str, Any]:
    first = rows[0]
    sigmas_m = [row["sigma"] for row in rows]
    joints = weighted_mean([json.loads(row["joints"]) for row in rows], sigmas_m)
    point = weighted_mean([[row[axis] for axis in "xyz"] for row in rows], sigmas_m)
    merged: dict[str, Any] = {"step": first["step"], POSE: first["pose"] + 1}
    if first["purpose"]:
        merged[PURPOSE] = first["purpose"]
    merged |= {f"q{j + 1}": value for j, value in enumerate(joints.tolist())}
    merged |= dict(zip("xyz", point.tolist(), strict=True))
    merged["sigma"] = sigma_of_mean_m(sigmas_m)
    turned = [row for row in rows if row["qw"] is not None]
    if turned:
        turns = np.array([[row[name] for name in TURN] for row in turned], dtype=np.float64)
        turns *= np.where(turns @ turns[0] < 0.0, -1.0, 1.0)[:, None]
        turn = weighted_mean(turns.tolist(), [row["sigma"] for row in turned])
        merged |= dict(zip(TURN, (turn / np.linalg.norm(turn)).tolist(), strict=True))
    merged |= {APPROACH: first["approach"], READINGS: len(rows)}
    further = [{"temperature_c": row["temperature_c"]} | json.loads(row["features"]) for row in rows]
    return merged | _means(further)


def _means(told: list[dict[str, float | None]]) -> dict[str, float]:
    """Mean of each of several values by name, over those that are told: the finite ones, if there are any."""
    means = {}
    for name in dict.fromkeys(name for each in told for name in each):
        values = [value for each in told if (value := each.get(name)) is not None]
        values = [value for value in values if math.isfinite(value)] or values
        if values:
            means[name] = sum(values) / len(values)
    return means


def _with_group(table: pd.DataFrame, session: Session) -> pd.DataFrame:
    """The table with a column "group", if there is something to say in it."""
    group, moved = session.meta(GROUP), unsure_steps(session)
    if group is None and not moved:
        return table
    name = _name(session)
    place = f"{group}, {name}" if group else name
    groups = pd.Series(group or name, index=table.index)
    for number, steps in enumerate(moved, start=1):
        groups[table["step"].isin(list(steps))] = f"{place}, moved {number}"
    return table.assign(group=groups)


def _name(session: Session) -> str:
    """What sets a session apart from others, whatever its file is called: when it began, to the microsecond.

    Between two sessions device and target may have been put elsewhere; equal groups mean that they were not.
    """
    began_s = session.meta("created_s")
    if began_s is None:
        raise InputError(
            "meta holds no created_s",
            where=str(session.path),
            rule="Set-ups in which something moved are called after when the session began",
            way_out=PUT_BACK,
        )
    return f"session of {datetime.fromtimestamp(began_s, UTC):%Y-%m-%d %H:%M:%S.%f}"
