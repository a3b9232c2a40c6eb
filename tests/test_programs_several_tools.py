"""Joint targets that are used with several tools, as home positions are."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.programs_rig import ABB, Shift, models, read, rewritten
from tests.test_programs_rapid import UNUSED
from tests.test_programs_retaught import RETAUGHT, compensating, far_mm
from truearm.programs.uses import SEVERAL

Q_DEG = [10, 5, 20, 30, 40, -50]
LONG, SHORT = (
    f"PERS tooldata {name}:=[TRUE,[[{x},0,{z}],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
    for name, x, z in (("tG", 0, 120), ("tH", 30, 60))
)
LENGTHS_M = [0.12, 0.06]


def home(*tools):
    """A program that goes home with each of the tools."""
    moves = "".join(f"MoveAbsJ jHome,v100,fine,{tool};\n" for tool in tools)
    target = f"CONST jointtarget jHome:=[{Q_DEG},{UNUSED}];\n"
    return f"MODULE M\n{LONG}{SHORT}{target}PROC main()\n{moves}ENDPROC\nENDMODULE\n"


class ByLength(Shift):
    """A stand-in that is less certain of longer tools, and refuses those beyond `most_m`."""

    most_m = 1.0

    def joints(self, q, *, tool=None, author=None):
        self.refuse = (0,) if tool[2, 3] > self.most_m else ()
        found = super().joints(q, tool=tool, author=author)
        found.std_mm = found.correction_mm = np.full(len(q), tool[2, 3])
        return found


@pytest.fixture(scope="module")
def irb():
    return compensating(ABB)


def test_one_change_suits_all_tools_where_whole_poses_are_met(irb):
    calibration, given = irb
    done = rewritten(read("a.mod", home("tG", "tH", "tool0"), ABB), given)
    assert (done.changed.tolist(), done.listed) == ([True], ())
    for one in done.program.environments:
        meant = ABB.pose(np.deg2rad([Q_DEG])) @ one.tool.true
        assert far_mm(calibration.pose(done.corrected, tool=one.tool.true), meant).max() < 1e-3
        assert far_mm(ABB.pose(done.corrected) @ one.tool.true, meant).max() < done.correction_mm[0] + 1e-6


@pytest.mark.parametrize(
    "options", [{}, {"task": "axis"}, {"task": "position"}, {"moving": (1, 2, 3)}], ids=str
)
def test_where_less_is_met_the_change_depends_on_the_tool(irb, tmp_path, options):
    program = tmp_path / "a.mod"
    program.write_text(home("tG", "tH"))
    compensator = ta.Compensator(irb[0], limits=ta.Limits(largest_std_mm=50.0), **options)
    done = ta.compensate_program(program, compensator, controller="nominal")
    assert [one.reason for one in done.listed] == ([SEVERAL] if options else [])
    assert done.changed.all() != bool(options)


def test_a_tool_that_is_elsewhere_than_the_controller_has_it_needs_a_change_of_its_own():
    done = rewritten(read("a.mod", home("tG", "tH"), ABB, RETAUGHT), models(ABB))
    assert [one.reason for one in done.listed] == [SEVERAL]
    again_and_again = rewritten(read("a.mod", home("tG", "tG"), ABB, RETAUGHT), models(ABB))
    assert again_and_again.changed.all()


@pytest.mark.parametrize("tools", [("tG", "tH"), ("tH", "tG")])
def test_the_worst_of_the_tools_counts(tools):
    given = replace(models(ABB), compensator=ByLength(np.full(6, 1e-3)))
    done = rewritten(read("a.mod", home(*tools), ABB), given)
    assert done.changed.all()
    assert done.std_mm[0] == done.correction_mm[0] == pytest.approx(max(LENGTHS_M))
    given.compensator.most_m = 0.1
    done = rewritten(read("a.mod", home(*tools), ABB), given, on_refusal="keep-nominal")
    assert [one.reason for one in done.kept] == ["too far"]
    assert np.isnan(done.correction_mm[0])
    assert np.rad2deg(done.corrected[0]) == pytest.approx(Q_DEG)


@pytest.mark.parametrize("tools", [("tG", "tH"), ("tH", "tG")])
def test_what_the_least_certain_tool_leaves_open_counts(tools):
    variances = np.diag([0.04, 0.04, 0.04, 0.0, 0.0, 0.0]).tolist()
    touched = f"[tool.tG]\nxyz = [0, 0, 120]\nidentified = {{covariance = {variances}}}\n"
    done = rewritten(read("a.mod", home(*tools), ABB, touched), models(ABB))
    assert done.std_mm[0] == pytest.approx(np.hypot(0.1, 0.2 * np.sqrt(3.0)))
