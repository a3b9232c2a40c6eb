"""The tables of a session file; docs/reference/session-file.md explains them."""

from typing import Final

VERSION: Final = 1
SCHEMA: Final = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE steps (
    step INTEGER PRIMARY KEY,
    kind TEXT NOT NULL CHECK (kind IN ('registration', 'pose', 'check')),
    pose INTEGER NOT NULL,
    purpose TEXT NOT NULL,
    approach INTEGER NOT NULL,
    readings TEXT NOT NULL
);
CREATE TABLE readings (
    step INTEGER NOT NULL REFERENCES steps (step),
    attempt INTEGER NOT NULL,
    time_s REAL NOT NULL,
    joints TEXT NOT NULL,
    x_m REAL, y_m REAL, z_m REAL,
    qw REAL, qx REAL, qy REAL, qz REAL,
    sigma_m REAL NOT NULL,
    valid INTEGER NOT NULL,
    reason TEXT NOT NULL,
    expected_x_m REAL NOT NULL, expected_y_m REAL NOT NULL, expected_z_m REAL NOT NULL,
    temperature_c REAL,
    features TEXT NOT NULL,
    raw TEXT NOT NULL,
    PRIMARY KEY (step, attempt)
) WITHOUT ROWID;
CREATE TABLE outcomes (
    step INTEGER PRIMARY KEY REFERENCES steps (step),
    outcome TEXT NOT NULL CHECK (outcome IN ('measured', 'skipped')),
    reason TEXT NOT NULL,
    attempts TEXT NOT NULL,
    time_s REAL NOT NULL
);
CREATE TABLE registration (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    world_from_base TEXT NOT NULL,
    residual_mm REAL NOT NULL,
    poses INTEGER NOT NULL,
    time_s REAL NOT NULL
);
CREATE TABLE stretches (
    measured INTEGER PRIMARY KEY,
    model TEXT NOT NULL,
    mean_mm REAL NOT NULL, p95_mm REAL NOT NULL, expected_mm REAL NOT NULL,
    time_s REAL NOT NULL
);
CREATE TABLE events (
    id INTEGER PRIMARY KEY,
    time_s REAL NOT NULL,
    step INTEGER,
    kind TEXT NOT NULL,
    message TEXT NOT NULL
);
"""
