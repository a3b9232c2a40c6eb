"""Forward pose and parameter Jacobian, against pinocchio in a Python loop and against vectorised NumPy."""

import json
import sys
from functools import cache

import numpy as np

from benches import numpy_kinematics
from benches.ours import measured_with_threads
from benches.timing import Comparison, Results, Series, seconds_of
from truearm import _core

# A six-axis arm of a UR10's size; m and rad.
TABLE = np.array(
    [
        [0.0, 0.1273, 0.0, np.pi / 2, 0.0],
        [0.0, 0.0, -0.612, 0.0, 0.0],
        [0.0, 0.0, -0.5723, 0.0, 0.0],
        [0.0, 0.163941, 0.0, np.pi / 2, 0.0],
        [0.0, 0.1157, 0.0, -np.pi / 2, 0.0],
        [0.0, 0.0922, 0.0, 0.0, 0.0],
    ]
)
END = np.array([[1.0, 0.0, 0.0, 0.01], [0.0, 1.0, 0.0, 0.02], [0.0, 0.0, 1.0, 0.15], [0.0, 0.0, 0.0, 1.0]])
POSES, JACOBIANS = 1_000_000, 100_000
# A loop takes the same time for every pose, so a part of the poses tells the time of all.
LOOP_POSES = 20_000
GROWTH = (1, 100, 1000, 10_000, 100_000)
POSE_RATIOS, JACOBIAN_RATIOS = {"pin loop": 45.0, "NumPy": 20.0}, {"pin loop": 25.0, "NumPy": 10.0}
SAME = 1e-12


def joints(n):
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (n, len(TABLE)))


@cache
def chain():
    return _core.Chain("standard", ["revolute"] * len(TABLE), TABLE, np.eye(4), END)


class PinocchioArm:
    """The same arm as pinocchio sees it: joints about z, each placed by the links before it."""

    def __init__(self, table=TABLE):
        import pinocchio  # noqa: PLC0415 - the bench's own processes do without it

        self.pin = pin = pinocchio
        self.model = pin.Model()
        placement, parent = pin.SE3.Identity(), 0
        for theta, d, a, alpha, _ in table:
            here = placement * pin.SE3(pin.utils.rotate("z", theta), np.zeros(3))
            parent = self.model.addJoint(parent, pin.JointModelRZ(), here, f"joint{parent + 1}")
            placement = pin.SE3(pin.utils.rotate("x", alpha), np.array([a, 0.0, d]))
        end = pin.Frame("end", parent, 0, placement * pin.SE3(END), pin.FrameType.OP_FRAME)
        self.frame = self.model.addFrame(end)
        self.data = self.model.createData()

    def poses(self, q, out):
        pin, model, data, frame = self.pin, self.model, self.data, self.frame
        for i, row in enumerate(q):
            pin.framesForwardKinematics(model, data, row)
            out[i] = data.oMf[frame].homogeneous
        return out

    def regressors(self, q, out):
        pin, model, data, frame = self.pin, self.model, self.data, self.frame
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        for i, row in enumerate(q):
            pin.framesForwardKinematics(model, data, row)
            out[i] = pin.computeFrameKinematicRegressor(model, data, frame, world)
        return out


def run():
    """Compare, and check that all give the same numbers."""
    arm = PinocchioArm()
    check(arm)
    per_thread = {threads: measured_with_threads("kinematics", threads) for threads in (1, 2)}
    labels = [f"{n} poses" for n in GROWTH]
    series = [
        Series(
            f"{name}, {threads} thread{'' if threads == 1 else 's'}",
            labels,
            [found[name][str(n)] for n in GROWTH],
        )
        for name in ("forward pose", "3 x 30 Jacobian")
        for threads, found in per_thread.items()
    ]
    remarks = [
        "All write into a given array. pinocchio's loop takes each result out of its data; its regressor is "
        "the motion by joint placements, 6 x 36. "
        f"It was timed on {LOOP_POSES} poses and counted for all."
    ]
    return Results("Kinematics", [*forward_poses(arm), *jacobians(arm)], series, remarks)


def forward_poses(arm):
    q, out = joints(POSES), np.zeros((POSES, 4, 4))
    ours = seconds_of(lambda: chain().pose(q, out=out, threads=1))
    peers = {
        "pin loop": seconds_of(lambda: arm.poses(q[:LOOP_POSES], out)) * POSES / LOOP_POSES,
        "NumPy": seconds_of(lambda: numpy_kinematics.poses(TABLE, END, q, out), repeats=3),
    }
    return [
        Comparison(f"forward pose, {POSES} poses", peer, ours, theirs, POSE_RATIOS[peer])
        for peer, theirs in peers.items()
    ]


def jacobians(arm):
    q, out = joints(JACOBIANS), np.zeros((JACOBIANS, 3, TABLE.size))
    regressors = np.zeros((LOOP_POSES, 6, 6 * len(TABLE)))
    ours = seconds_of(lambda: chain().parameter_jacobian(q, out=out, threads=1))
    loop = seconds_of(lambda: arm.regressors(q[:LOOP_POSES], regressors))
    peers = {
        "pin loop": loop * JACOBIANS / LOOP_POSES,
        "NumPy": seconds_of(lambda: numpy_kinematics.jacobian(TABLE, END, q, out), repeats=3),
    }
    return [
        Comparison(f"3 x 30 parameter Jacobian, {JACOBIANS} poses", peer, ours, theirs, JACOBIAN_RATIOS[peer])
        for peer, theirs in peers.items()
    ]


def check(arm):
    """Raise ValueError unless poses, and what of the Jacobians is the same quantity, agree."""
    q = joints(1000)
    found, columns = chain().pose(q), chain().parameter_jacobian(q)
    regressor = arm.regressors(q, np.zeros((1000, 6, 6 * len(TABLE))))
    # Turning and shifting a joint's placement about and along z are theta and d.
    apart = {
        "poses and pinocchio's": found - arm.poses(q, np.zeros_like(found)),
        "poses and NumPy's": found - numpy_kinematics.poses(TABLE, END, q, np.zeros_like(found)),
        "Jacobians and NumPy's": columns - numpy_kinematics.jacobian(TABLE, END, q, np.zeros_like(columns)),
        "theta and pinocchio's": columns[:, :, 0::5] - regressor[:, :3, 5::6],
        "d and pinocchio's": columns[:, :, 1::5] - regressor[:, :3, 2::6],
    }
    for what, difference in apart.items():
        if np.abs(difference).max() > SAME:
            raise ValueError(f"{what} differ by {np.abs(difference).max():.1e}")


def growth():
    """Seconds of a call for each number of poses, on as many threads as this process may use."""
    works = {"forward pose": (pose, (4, 4)), "3 x 30 Jacobian": (jacobian, (3, TABLE.size))}
    return {
        name: {str(n): _seconds(work, joints(n), np.zeros((n, *shape))) for n in GROWTH}
        for name, (work, shape) in works.items()
    }


def pose(q, out):
    return chain().pose(q, out=out)


def jacobian(q, out):
    return chain().parameter_jacobian(q, out=out)


def _seconds(work, q, out):
    return seconds_of(lambda: work(q, out))


if __name__ == "__main__":
    json.dump(growth(), sys.stdout)
