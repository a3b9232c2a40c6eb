"""Small calibrations to report, and what is read from their pages."""

import base64
import gzip
import html
import json
import re

import numpy as np

import truearm as ta
from truearm.simulation import VirtualArm

POSES = 90


def small_calibration(model, **more):
    """A calibration of the paper's arm from few poses."""
    arm = VirtualArm.paper(seed=2)
    return ta.calibrate(arm.robot, arm.measure(arm.poses(POSES)), model=model, **more)


def write_arm_and_later(folder):
    """A small calibration, arm.calib, and other measurements of its arm, later.csv."""
    small_calibration("constant").save(folder / "arm.calib")
    arm = VirtualArm.paper(seed=2)
    arm.measure_table(arm.poses(40, seed=3), seed=3).to_csv(folder / "later.csv", index=False)
    return folder


def figures_of(page):
    """What the page's script draws: palettes, layout and figures."""
    return json.loads(re.findall(r'<script type="application/json" id="figures">(.*?)</script>', page)[0])


def script_of(page):
    """The plotting script that the page holds."""
    packed = re.findall(r'<script type="text/plain" id="plotly">(.*?)</script>', page)[0]
    return gzip.decompress(base64.b64decode(packed)).decode()


def words_of(page):
    """The page as a reader sees it, without its scripts and style."""
    shown = re.sub(r"<(script|style)\b.*?</\1>", " ", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", shown)))


def errors_table(page):
    """The cells of the first table by the name of the model."""
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", page, flags=re.DOTALL)
    cells = [
        [re.sub(r"<[^>]+>", "", cell).strip() for cell in re.findall(r"<td.*?</td>", row)] for row in rows
    ]
    return {row[0]: row[1:] for row in cells if row and row[0] in ("nominal", "constant", "variable")}


def repeated_measurements(sides_apart_mm, noise_mm, seed=0):
    """Poses of a UR10, each measured eight times, joint 2 coming from below and above in turn."""
    rng = np.random.default_rng(seed)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    places = rng.uniform(-1.0, 1.0, (25, 6))
    joint_2 = np.eye(6)[1]
    readings, sides = [], []
    for place in places:
        for sign in (-1.0, 1.0) * 4:
            readings += [place - sign * rng.uniform(0.2, 0.4) * joint_2, place]
            sides += [0.0, sign]
    q, side = np.array(readings), np.array(sides)
    table = arm.measure_table(q)
    clean = arm.true_position(q) + rng.normal(scale=1e-3 * noise_mm, size=(len(q), 3))
    table[["x", "y", "z"]] = clean
    table["z"] += 0.5e-3 * sides_apart_mm * side
    return arm.robot, ta.Measurements.from_dataframe(table)
