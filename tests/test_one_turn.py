"""Where poses are drawn: all of a joint's limits, one turn at the most, and all of a rail."""

import numpy as np
import pytest

from truearm.cell.plan import PlanOptions, plan_poses
from truearm.description.one_turn import one_turn
from truearm.robot import Robot

PI = np.pi


def arm(*limits: tuple[str, float, float]) -> Robot:
    rows = "".join(
        f'[[link]]\njoint = "{kind}"\na = 0.4\nalpha = 1.5\nlimits = [{low}, {high}]\n'
        for kind, low, high in limits
    )
    return Robot.from_toml(
        f'name = "arm"\nconvention = "standard"\nlength_unit = "m"\nangle_unit = "rad"\n{rows}'
    )


@pytest.mark.parametrize(
    ("kind", "limits", "expected"),
    [
        ("revolute", (-1.0, 2.0), (-1.0, 2.0)),
        ("revolute", (0.8, 5.4), (0.8, 5.4)),
        ("revolute", (3.5, 6.0), (3.5, 6.0)),
        ("revolute", (-2.0 * PI, 2.0 * PI), (-PI, PI)),
        ("revolute", (-2.4, 8.7), (-2.4, 2.0 * PI - 2.4)),
        ("revolute", (-9.0, 1.0), (1.0 - 2.0 * PI, 1.0)),
        ("revolute", (-np.inf, np.inf), (-PI, PI)),
        ("revolute", (4.0, np.inf), (4.0, 4.0 + 2.0 * PI)),
        ("prismatic", (0.0, 12.0), (0.0, 12.0)),
        ("prismatic", (-np.inf, np.inf), (-0.5, 0.5)),
        ("prismatic", (-np.inf, 0.2), (-0.8, 0.2)),
    ],
)
def test_one_turn(kind: str, limits: tuple[float, float], expected: tuple[float, float]) -> None:
    low, high = one_turn(arm(("revolute", -1.0, 1.0), (kind, *limits)))
    np.testing.assert_allclose([low[0], high[0]], [-1.0, 1.0], rtol=0.0, atol=0.0)
    np.testing.assert_allclose([low[1], high[1]], expected, atol=1e-12)


def test_a_plan_goes_all_along_a_rail_and_beyond_half_a_turn() -> None:
    """Readings were cut at 3.14, rad and m."""
    robot = arm(
        ("prismatic", 0.0, 9.0), ("revolute", 0.8, 5.4), ("revolute", 3.5, 6.0), ("revolute", -1.0, 1.0)
    )
    planned = plan_poses(robot, PlanOptions(count=30, link_radius_mm=0.0))
    q = np.asarray(planned.poses.readings)
    low, high = robot.limits.T
    assert ((q >= low) & (q <= high)).all()
    assert (np.ptp(q, axis=0) > 0.8 * (high - low)).all()
