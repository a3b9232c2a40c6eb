"""The robot: its files, and the kinematics of its nominal table."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from truearm._core import Chain
from truearm.arrays import as_rows, check_out
from truearm.description import robot_dict, robot_toml
from truearm.description.library import library_text
from truearm.description.robot_checks import check_sizes
from truearm.description.robot_data import Convention, Joint, RobotData
from truearm.description.robot_file import parse_robot_file
from truearm.description.robot_table import table_fields
from truearm.description.urdf import UrdfChain, read_urdf, urdf_chain
from truearm.errors import InputError, TruearmError
from truearm.files import is_file, read_text
from truearm.types import Floats
from truearm.units import MRAD_PER_RAD

URDF_ENDINGS: Final = (".urdf", ".xml")
TABLE_ENDINGS: Final = (".csv", ".tsv", ".txt", ".xlsx")


class Robot(RobotData):
    """A serial arm as its maker means it to be, and its kinematics. SI units; all arrays are read-only.

    `load`, `from_table`, `from_toml` and `from_urdf` make one, and `dataclasses.replace(robot, tool=...)`
    makes one with another field. `q` is always joint readings, what the controller shows, in rad and m.

    Parameters are in the order links, base to flange, and within a link theta, d, a, alpha, beta.
    A joint reading becomes a Denavit-Hartenberg joint value by q_dh = coupling . reading; it is added
    to theta of a revolute joint's row, to d of a prismatic joint's row.

    base_from_tool = base . A1 ... AN . flange . tool, where A is
    Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta) in the standard convention and
    Rx(alpha) Tx(a) Ry(beta) Rz(theta) Tz(d) in the modified one.

    Attributes:
        name: What people call it.
        source: Where its numbers come from.
        convention: "standard" or "modified".
        joints: "revolute" or "prismatic" for each of the N joints.
        table: Nominal parameters (N, 5).
        base: Fixed transform (4, 4) before the first link.
        flange: Fixed transform (4, 4) after the last link.
        tool: Fixed transform (4, 4) from flange to tool.
        base_row: Denavit-Hartenberg row (5,) that `base` was given as; None where it was not, and in an arm
            with another base.
        coupling: Joint values from readings (N, N), directions included.
        limits: Lowest and highest reading (N, 2); infinite where there is none.
        payload: What the arm carried, `mass_kg` and `centre_of_gravity_mm`, if stated.
        urdf_names: Names of its links and joints, if it was read from a URDF.
    """

    @classmethod
    def load(cls, name_or_path: str | Path) -> "Robot":
        """A robot of the library by name (case ignored), or from a TOML or URDF file.

        A URDF's chain is given behind its path: "arm.urdf#tool0" or "arm.urdf#base_link,tool0".

        Raises:
            InputError: If there is no such robot or file, or the file breaks a rule, or more than two links
                are named.
        """
        given = str(name_or_path)
        path = Path(given)
        urdf, _, chain = given.partition("#")
        if Path(urdf).suffix.lower() in URDF_ENDINGS:
            *base, tip = [part.strip() or None for part in chain.split(",")]
            if len(base) > 1:
                raise InputError(
                    f'"{chain}" names {len(base) + 1} links',
                    where=given,
                    rule="A chain is named by its tip link, or by its base link and its tip link",
                )
            return cls.from_urdf(urdf, base_link=base[0] if base else None, tip_link=tip)
        if Path(urdf).suffix.lower() == ".xacro":
            xacro = Path(urdf)
            raise InputError(
                "this is a xacro macro, not a URDF",
                where=given,
                way_out=f"Expand it first: xacro {xacro.name} > {xacro.stem.removesuffix('.urdf')}.urdf",
            )
        if path.suffix.lower() in TABLE_ENDINGS and is_file(path):
            raise InputError(
                "this looks like a table of measurements, not like a robot",
                where=given,
                rule="A robot is a name from the library (truearm robots), a TOML file or a URDF",
                way_out="Name the robot before the measurements: truearm calibrate ROBOT MEASUREMENTS",
            )
        is_path = "/" in given or "\\" in given or given in {".", ".."}
        if path.suffix.lower() == ".toml" or is_file(path) or is_path:
            return cls.from_toml(read_text(path), where=given)
        name, text = library_text(given)
        return cls.from_toml(text, where=f"{name}.toml")

    @classmethod
    def from_toml(cls, text: str, *, where: str = "robot") -> "Robot":
        """A robot from the text of a robot file; `where` names it in messages.

        Raises:
            InputError: If the text is no robot file; names the key and the rule.
        """
        file = parse_robot_file(text, where=where)
        try:
            robot = cls(**robot_toml.fields_of(file))
            check_sizes(robot)
        except TruearmError as error:
            raise error.at(where) from None
        return robot

    @classmethod
    def from_table(
        cls,
        name: str,
        table: ArrayLike,
        *,
        joints: Sequence[Joint] | None = None,
        convention: Convention = "standard",
        limits: ArrayLike | None = None,
        coupling: ArrayLike | None = None,
    ) -> "Robot":
        """A robot from its Denavit-Hartenberg table; base, flange and tool are where the table has them.

        Args:
            name: What people call it.
            table: theta, d, a and alpha of each link, (N, 4) in rad and m, base to flange; (N, 5) with beta.
                theta, or d of a prismatic joint, is what is added to the joint's value.
            joints: "revolute" or "prismatic" for each joint; all are revolute by default.
            convention: "standard", or "modified" where alpha and a of a row are of the link before its joint.
            limits: Lowest and highest reading (N, 2), infinite where there is none; none by default.
            coupling: Joint values from readings (N, N): the identity by default, with -1 on the diagonal
                where a reading counts the other way.

        Raises:
            InputError: If an array has another shape, a word is not known, or angles or lengths can only be
                in another unit.
        """
        robot = cls(
            **table_fields(table, joints, limits, coupling), name=name, source="", convention=convention
        )
        check_sizes(robot)
        return robot

    @classmethod
    def from_urdf(
        cls, path: str | Path, base_link: str | None = None, tip_link: str | None = None
    ) -> "Robot":
        """A robot from the chain of a URDF, converted exactly to standard Denavit-Hartenberg rows.

        Args:
            path: The URDF. Meshes are not read.
            base_link: Link in whose frame poses are given; the root by default.
            tip_link: Link that is the flange; by default the only leaf that moves.

        Raises:
            InputError: If the file is no URDF, or the chain is not told, or is not serial.
        """
        return cls._from_chain(read_urdf(Path(path), base_link, tip_link), Path(path).name)

    @classmethod
    def from_urdf_text(
        cls, text: str, base_link: str | None = None, tip_link: str | None = None, *, where: str = "URDF"
    ) -> "Robot":
        """A robot from the chain of a URDF that is given as text; `where` names it in messages.

        Raises:
            InputError: As :meth:`from_urdf`.
        """
        return cls._from_chain(urdf_chain(text, base_link, tip_link, where=where), where)

    @classmethod
    def _from_chain(cls, chain: UrdfChain, where: str) -> "Robot":
        return cls(
            name=chain.name or where,
            source=_source(chain, where),
            convention="standard",
            joints=chain.joints,
            table=chain.table,
            base=chain.base,
            flange=chain.flange,
            tool=np.eye(4),
            base_row=None,
            coupling=np.eye(len(chain.joints)),
            limits=chain.limits,
            urdf_names=chain.names,
        )

    def __repr__(self) -> str:
        return f"<Robot {self.name}: {self.joint_count} joints, {self.convention} Denavit-Hartenberg>"

    def __reduce__(self) -> tuple[object, ...]:
        return type(self).from_dict, (self.to_dict(),)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Robot) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash((self.name, self.convention, self.joints))

    @cached_property
    def chain(self) -> Chain:
        """The compiled chain from base to tool, over Denavit-Hartenberg joint values."""
        return self._chain(self.flange @ self.tool)

    @cached_property
    def flange_chain(self) -> Chain:
        """The compiled chain from base to flange, over Denavit-Hartenberg joint values."""
        return self._chain(self.flange)

    def joints_from_readings(self, q: ArrayLike) -> Floats:
        """Denavit-Hartenberg joint values of readings `q`, (n, N) or (N,)."""
        rows, single = self._readings(q)
        values = np.array(self.values_of(rows))
        return values[0] if single else values

    def readings_from_joints(self, q_dh: ArrayLike) -> Floats:
        """Readings of Denavit-Hartenberg joint values `q_dh`, (n, N) or (N,)."""
        rows, single = as_rows(q_dh, self.joint_count, what="joint values")
        readings: Floats = np.asarray(np.linalg.solve(self.coupling, rows.T).T, dtype=np.float64)
        return readings[0] if single else readings

    def position(self, q: ArrayLike, out: Floats | None = None) -> Floats:
        """Tool points in the base frame, m: (n, 3) for readings `q` (n, N), (3,) for (N,)."""
        rows, single = self._readings(q)
        target = _target(out, rows, 3, single=single)
        result = self.chain.position(self.values_of(rows), out=target)
        return result[0] if single else result

    def pose(self, q: ArrayLike, out: Floats | None = None) -> Floats:
        """base_from_tool: (n, 4, 4) for readings `q` (n, N), (4, 4) for (N,)."""
        rows, single = self._readings(q)
        target = _target(out, rows, 4, 4, single=single)
        result = self.chain.pose(self.values_of(rows), out=target)
        return result[0] if single else result

    def parameter_jacobian(self, q: ArrayLike, pose: bool = False, out: Floats | None = None) -> Floats:
        """Derivatives with respect to the 5 N parameters of the links, link by link.

        Args:
            q: Readings (n, N) or (N,).
            pose: Whether to add the rotation, as a rotation vector in the base frame.
            out: Array to write to.

        Returns:
            (n, 3, 5 N), or (n, 6, 5 N) with translation first; without n for one reading.
        """
        rows, single = self._readings(q)
        target = _target(out, rows, 6 if pose else 3, 5 * self.joint_count, single=single)
        result = self.chain.parameter_jacobian(self.values_of(rows), pose=pose, out=target)
        return result[0] if single else result

    def joint_jacobian(self, q: ArrayLike, pose: bool = False) -> Floats:
        """Derivatives with respect to the readings: (n, 3, N), (n, 6, N) with `pose`; no n for (N,)."""
        rows, single = self._readings(q)
        result = self.chain.joint_jacobian(self.values_of(rows), pose=pose) @ self.coupling
        return result[0] if single else result

    def to_dict(self) -> dict[str, Any]:
        """All fields as JSON values; from_dict gives the same robot, bit for bit."""
        return robot_dict.to_dict(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Robot":
        """The robot that `to_dict` described; `source` may be missing.

        Raises:
            InputError: If a key is missing or a value has another shape.
        """
        return cls(**robot_dict.fields_of(content))

    def to_toml(self) -> str:
        """The text of a robot file in m and rad that from_toml reads back to this robot.

        Rotations of base, flange and tool are written as quaternions, so that they come back to rounding.
        """
        return robot_toml.write(self)

    def _chain(self, end: Floats) -> Chain:
        return Chain(self.convention, list(self.joints), self.table, self.base, end)

    def _readings(self, q: ArrayLike) -> tuple[Floats, bool]:
        return as_rows(q, self.joint_count, what=f"joint readings of {self.name}")

    def values_of(self, readings: Floats) -> Floats:
        """Internal: joint values (n, N) of checked readings (n, N): the same array where none is coupled."""
        return np.ascontiguousarray(readings @ self.coupling.T) if self.is_coupled else readings

    @cached_property
    def is_coupled(self) -> bool:
        """Whether joint values are other than the readings, if only in their direction."""
        return not np.array_equal(self.coupling, np.eye(self.joint_count))


def _source(chain: UrdfChain, where: str) -> str:
    ends = f"{where}, {chain.names.base_link} to {chain.names.tip_link}"
    if not chain.rounded_rad:
        return ends
    return f"{ends}; its right angles are rounded, by up to {MRAD_PER_RAD * chain.rounded_rad:.2g} mrad"


def _target(out: Floats | None, rows: Floats, *shape: int, single: bool) -> Floats | None:
    """What results (n, *shape) of rows (n, N) are written to, where `out` is given; without n for one."""
    check_out(out, *(shape if single else (len(rows), *shape)), given=rows)
    return out[None] if single and out is not None else out
