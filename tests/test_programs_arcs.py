"""Arcs that deviate by more than is allowed are told, for they get no waypoints."""

import numpy as np
import pytest

from tests.program_tools import Bend, rewritten
from tests.programs_rig import ABB
from tests.test_programs_melfa import MELFA
from tests.test_programs_vias import (
    AT_END,
    AT_VIA,
    DIALECTS,
    GO,
    MITSUBISHI,
    TOOL,
    arc_of,
    flange,
    near,
    of_melfa,
    of_rapid,
    on_circle,
)
from truearm.programs.densify import Spacing
from truearm.programs.rapid import RAPID


def off_circle(points, through):
    """How far points are from the circle through three others at most, by the bisectors of its chords."""
    a, b, c = through
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    rows = np.stack([b - a, c - a, normal])
    centre = np.linalg.solve(rows, [(b - a) @ (b + a) / 2, (c - a) @ (c + a) / 2, normal @ a])
    beside = (points - centre) @ normal
    radii = np.linalg.norm(points - centre - beside[:, None] * normal, axis=1)
    return float(np.hypot(beside, radii - np.linalg.norm(a - centre)).max())


def test_arcs_that_deviate_by_more_are_told_by_how_much():
    arc = arc_of(ABB, DIALECTS["RAPID"][3])
    text = of_rapid(arc)
    bound = Spacing.of(0.001, 5.0)
    (one,) = rewritten(RAPID(), text, ABB, by=Bend(), spacing=bound).deviating
    assert one.listed.name == f"MoveC p2,p3,{GO}"
    assert one.listed.reason == "an arc gets no waypoints: it deviates less in several shorter ones"
    angles = np.linspace(0.0, AT_END, 45)
    tools = np.stack([on_circle(arc.tools[0], angle, 30.0 * angle / AT_END) for angle in angles])
    q = near(ABB, tools, arc.q[0])
    written = (flange(ABB, q + Bend()) @ TOOL)[:, :3, 3]
    at_via = int(np.abs(angles - AT_VIA).argmin())
    expected = 1e3 * off_circle(written, written[[0, at_via, -1]])
    assert one.deviation_mm == pytest.approx(expected, rel=0.05)
    fine = rewritten(RAPID(), text, ABB, by=Bend(), spacing=Spacing.of(1.2 * one.deviation_mm, 5.0))
    assert fine.deviating == ()
    (notice,) = rewritten(RAPID(), text, ABB, by=Bend(), spacing=bound).notices
    assert notice.message.startswith("1 move deviates by more than 0.001 mm (--densify-mm)")


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ((f"MoveJ p1,{GO}", f"MoveC p2,p3,{GO}"), None),
        ((f"MoveC p2,p3,{GO}",), "where the arm comes from is not known"),
    ],
)
def test_arcs_whose_deviation_is_not_known_may_deviate(body, reason):
    arc = arc_of(ABB, DIALECTS["RAPID"][3])
    done = rewritten(RAPID(), of_rapid(arc, body), ABB, spacing=Spacing.of(0.001, 5.0))
    told = [(one.listed.reason, one.deviation_mm) for one in done.deviating]
    assert told == ([] if reason is None else [(reason, None)])


def test_arcs_without_a_via_point_may_deviate():
    arc = arc_of(MITSUBISHI, DIALECTS["MELFA"][3])
    text = of_melfa(arc, ("Mov P1", "Mvr2 P1,P3,P2"))
    (one,) = rewritten(MELFA, text, MITSUBISHI, by=Bend(), spacing=Spacing.of(0.001, 5.0)).deviating
    assert one.deviation_mm is None
    assert "is followed only of arcs past a via point" in one.listed.reason
