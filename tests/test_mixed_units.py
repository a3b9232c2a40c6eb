"""Single rows in another unit than the others are named; gross rows and points near the origin are not."""

import numpy as np
import pytest

import truearm as ta
from truearm.doubts.mixed_units import check_mixed_units
from truearm.doubts.plausibility import check_against
from truearm.errors import InputError
from truearm.simulation import VirtualArm

ROBOT = ta.Robot.load("ur10")
POINT = ["x", "y", "z"]
JOINTS = [f"q{k}_deg" for k in range(1, 7)]


def table_of(seed=3, count=40):
    arm = VirtualArm(ROBOT, seed=seed)
    return arm.measure_table(arm.poses(count))


def in_degrees():
    table = table_of()
    return table.rename(columns={f"q{k}": f"q{k}_deg" for k in range(1, 7)}).assign(
        **{f"q{k}_deg": np.degrees(table[f"q{k}"]) for k in range(1, 7)}
    )


def check(table):
    check_mixed_units(ta.Measurements.from_dataframe(table), ROBOT)


def refusal(table):
    """What is refused of measurements; None where nothing is."""
    try:
        check(table)
    except InputError as error:
        return str(error)
    return None


@pytest.mark.parametrize("rows", [[20], [20, 21, 22], [3, 11, 30]])
@pytest.mark.parametrize(
    ("factor", "words"),
    [(1e3, "mm among rows in m.*divide by 1000"), (1e-3, "m among rows in mm.*multiply by 1000")],
)
def test_rows_in_another_unit_of_length_are_named_with_both_sizes(rows, factor, words):
    table = table_of()
    table.loc[rows, POINT] *= factor
    named = ", ".join(str(row + 1) for row in rows[:-1])
    with pytest.raises(InputError, match=rf"rows? .*{named}.*those of the other rows .* m: .*{words}"):
        check_against(ta.Measurements.from_dataframe(table), ROBOT)


def test_rows_in_radians_among_degrees_are_named():
    table = in_degrees()
    table.loc[[7, 8], JOINTS] = np.radians(table.loc[[7, 8], JOINTS])
    with pytest.raises(InputError, match=r"joint readings in rows 8 and 9 are .* radians among rows in deg"):
        check(table)


def test_a_pose_with_all_joints_near_zero_is_in_degrees():
    arm = VirtualArm(ROBOT, seed=3)
    near = arm.measure_table(np.concatenate([arm.poses(40), np.radians([[0.0] * 6, [2.0] * 6])]))
    table = near.rename(columns={f"q{k}": f"q{k}_deg" for k in range(1, 7)})
    degrees = {name: np.degrees(near[f"q{k}"]) for k, name in enumerate(JOINTS, 1)}
    assert refusal(table.assign(**degrees)) is None


def test_distances_in_another_unit_are_named():
    table = table_of()
    far = np.linalg.norm(table[POINT], axis=1)
    wire = table.drop(columns=POINT).assign(anchor="box", distance=far)
    assert refusal(wire) is None
    wire.loc[5, "distance"] *= 1e3
    with pytest.raises(InputError, match=r"distances in row 6 are .* m, those of the other rows .* mm among"):
        check(wire)


@pytest.mark.parametrize("factor", [50.0, 2e4])
def test_a_gross_row_is_no_unit(factor):
    table = table_of()
    table.loc[20, POINT] *= factor
    assert refusal(table) is None


@pytest.mark.parametrize("seed", range(5))
def test_a_point_near_the_origin_of_the_device_is_no_unit(seed):
    table = table_of(seed)
    table[POINT] -= table.loc[20, POINT] + 0.001
    assert refusal(table) is None
