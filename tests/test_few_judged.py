"""Few poses that were judged do not tell whether a calibration helps."""

import numpy as np
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm.cli.calibrate import suggest_next
from truearm.doubts.few_judged import UNDECIDED, FewJudged
from truearm.doubts.of_results import LARGE_MM, NO_HELP, ROWS_SHIFTED
from truearm.errors import Notice
from truearm.fits.models import CONSTANT, NOMINAL
from truearm.fleet.doubted import undecided_notice
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.validation import FEW_HELD, RowErrors
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm

WRONG = Notice(NO_HELP, "The calibration does not help.")


def judged(poses, ahead_mm, scatter_mm):
    """Poses on which the nominal model is ahead of constants by so much, give or take."""
    apart = 1e-3 * (ahead_mm + scatter_mm * np.resize([1.0, -1.0], poses))
    errors = {NOMINAL: np.full(poses, 2e-3), CONSTANT: 2e-3 + apart}
    vectors = {name: RowErrors(np.outer(each, [1.0, 0.0, 0.0])) for name, each in errors.items()}
    q = np.linspace(0.0, 1.0, poses)[:, None]
    held = HeldRows(q, np.arange(poses) + 1, np.full(poses, "rows.csv"), vectors)
    return FewJudged(held, poses, "held-out", CONSTANT)


@pytest.fixture(scope="module")
def fifteen():
    """A right calibration of as few poses as can be, whose five held-out ones do not show that it helps."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=12, imperfections=Imperfections(share=1.0))
    return ta.calibrate(arm.robot, arm.measure(arm.poses(15)), model="constant", refit=False)


@pytest.mark.parametrize(
    ("poses", "ahead_mm", "after_mm", "kind"),
    [
        (6, 0.2, 2.2, UNDECIDED),
        (6, 1.5, 3.5, NO_HELP),
        (6, 0.2, LARGE_MM, NO_HELP),
        (FEW_HELD, 0.2, 2.2, NO_HELP),
        (1, 1.5, 3.5, UNDECIDED),
    ],
)
def test_what_chance_may_make_of_few_poses_is_no_wrong_data(poses, ahead_mm, after_mm, kind):
    (told,) = judged(poses, ahead_mm, 1.0).told([WRONG], 2.0, after_mm, "mean error")
    assert told.kind == kind


def test_reasons_that_are_known_are_no_chance():
    told = judged(6, 0.2, 1.0).told([WRONG, Notice(ROWS_SHIFTED, "Row by row.")], 2.0, 2.2, "mean error")
    assert told[0] is WRONG


def test_a_report_on_few_poses_asks_for_more_and_not_for_mistakes(fifteen):
    errors = fifteen.validation.holdout
    assert errors[CONSTANT].position.mean > errors[NOMINAL].position.mean
    made = report(fifteen)
    assert "5 held-out poses do not tell whether the calibration helps" in undecided_notice(fifteen)
    assert made.verdict.endswith("So few do not tell whether the calibration helps: measure more poses.")
    assert [advice.kind for advice in made.advice] == ["more_poses", "few_held_out"]
    assert 'class="verdict fair"' in made.html


def test_what_constants_are_not_asked_is_no_automatic_option(fifteen):
    page = words_of(report(fifteen).html)
    assert "movement of set-ups while measuring taken out not looked for" in page


def test_what_comes_next_judges_it_on_others_and_corrects_nothing(fifteen, tmp_path, capsys):
    suggest_next(fifteen, tmp_path / "arm.calib")
    told = capsys.readouterr().out
    assert "truearm evaluate" in told
    assert "truearm compensate" not in told


def test_few_other_measurements_tell_no_more(fifteen):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=12, imperfections=Imperfections(share=1.0))
    kinds = {
        notice.kind
        for seed in (3, 5)
        for notice in ta.evaluate(fifteen, arm.measure(arm.poses(12, seed=seed), seed=seed)).notices
    }
    assert kinds >= {UNDECIDED}
    assert NO_HELP not in kinds
