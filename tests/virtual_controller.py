"""A controller that runs programs: its own kinematics and inverse kinematics, configuration data obeyed."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from truearm.inverse import Inverse
from truearm.programs.layouts import of_joints
from truearm.programs.tables import Motion
from truearm.robot import Robot

AT_LEAST = 1e-6


@dataclass(frozen=True)
class VirtualController:
    """What moves an arm.

    Attributes:
        robot: The model that it computes with.
    """

    robot: Robot

    def run(self, program):
        """Readings (m, N) where the arm stands after each motion of a program."""
        inverse, stops, now = Inverse(self.robot), [], None
        for target, environment, motion in zip(
            program.moves.target, program.moves.environment, program.moves.motion, strict=True
        ):
            if motion == Motion.BESIDE:
                continue
            now = self._goal(program, int(target), program.environments[int(environment)], inverse, now)
            if motion != Motion.SEED:
                stops.append(now)
        return np.array(stops)

    def _goal(self, program, target, environment, inverse, now):
        targets = program.targets
        layout = program.layouts[targets.layout[target]]
        places = slice(targets.first[target], targets.first[target + 1])
        values = (targets.values[places] * targets.factors[places])[None]
        if of_joints(layout):
            return layout.to_readings(values)[0]
        width = layout.width - layout.configuration
        stored = environment.before @ layout.to_poses(values[:, :width])[0] @ environment.after
        base_from_tool = environment.work_object.controller @ stored
        flange = base_from_tool @ np.linalg.inv(environment.tool.controller)
        found = inverse.solutions(flange, turns=True)
        assert len(found), "out of reach"
        if layout.configuration:
            wanted = program.configuration.digits_of_text(values[:, width:])
            found = found[(program.configuration.digits(found) == wanted).all(axis=1)]
            assert len(found) == 1, "the configuration data is not obeyed by one set of joints"
            return found[0]
        return found[np.abs(found - now).max(axis=1).argmin()]


def euler(pose):
    """x, y, z in mm and the angles about z, y and x in deg of a pose (4, 4)."""
    angles = Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX", degrees=True)
    return [*(1e3 * pose[:3, 3]), *angles]


def numbers(values, decimals=4):
    """Numbers between commas."""
    return ", ".join(f"{value:.{decimals}f}" for value in values)
