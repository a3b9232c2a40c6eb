"""Curves of joints that ripple, and constants of which some kinds err more than others."""

import dataclasses

import numpy as np
import pytest

import truearm as ta
from truearm.reporting.facts import Facts
from truearm.reporting.parts import Table
from truearm.reporting.varying import varying
from truearm.simulation import VirtualArm
from truearm.simulation.imperfections import Harmonic, Imperfections, JointError


def calibrated(orders, **options):
    """A UR10 each of whose first five joints errs by harmonics of the given orders."""

    def harmonics(joint):
        phases = np.random.default_rng(joint).uniform(0.0, 360.0, len(orders))
        return tuple(Harmonic(order, 0.012, phase) for order, phase in zip(orders, phases, strict=True))

    errors = tuple(JointError(joint, harmonics=harmonics(joint)) for joint in range(1, 6))
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=Imperfections(joint_errors=errors))
    return ta.calibrate(arm.robot, arm.measure(arm.poses(180)), use="position", refit=False, **options)


@pytest.fixture(scope="module")
def rippling():
    return calibrated((11, 12, 13, 14))


def own_blocks(calibration):
    return [block for block in calibration.summary["blocks"] if block["name"] == "own"]


def test_ripples_are_found_and_told(rippling):
    for block in own_blocks(rippling):
        assert 10.0 < block["ripples"] < 15.0
    (table,) = (
        part
        for part in varying(Facts(rippling)).parts
        if isinstance(part, Table) and part.title == "Blocks of the field"
    )
    (own,) = (row for row in table.rows if row[0] == "own")
    assert str(own[1]).startswith("each of joints 1, 2, 3, 4, 5, 6, may ripple about 1")
    assert str(own[1]).endswith("times a turn")


def test_slow_errors_of_joints_do_not_ripple():
    assert not any("ripples" in block for block in own_blocks(calibrated((1, 2))))


def test_zeros_that_err_more_than_lengths_have_wider_priors():
    """Joints are mastered by hand, links are milled."""
    arm = VirtualArm(
        ta.Robot.load("ur10"),
        seed=3,
        imperfections=Imperfections(angle_deg=0.2, length_mm=0.02, share=0.05),
        parameters=[f"{kind}{joint}" for joint in range(2, 6) for kind in ("theta", "a")],
    )
    found = ta.calibrate(arm.robot, arm.measure(arm.poses(150)), use="position", refit=False)
    assert found.variable is not None
    zeros, _, lengths = found.variable.hyper["constant"]
    assert zeros > 5.0 * lengths


def test_files_of_one_factor_for_all_constants_and_without_ripples_are_read(rippling):
    details = rippling.variable
    assert details is not None
    shared = details.hyper | {"constant": [0.4] * 3, "own_cycles": [0.0], "unevenness": [1.0] * 6}
    since = "own_cycles", "unevenness"
    older = {name: value for name, value in shared.items() if name not in since} | {"constant": [0.4]}
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (20, 6))
    new, old = (
        dataclasses.replace(rippling, variable=dataclasses.replace(details, hyper=hyper)).position_std(q)
        for hyper in (shared, older)
    )
    np.testing.assert_array_equal(new, old)
    assert (new > 0.0).all()
