"""Measurements: joint readings and what was measured at them."""

import hashlib
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from truearm.arrays import as_row_numbers, check_columns, read_only
from truearm.errors import InputError, Notice, UsageError, count_of, list_names, list_rows
from truearm.files import as_path, name_in_text
from truearm.kinds import count as whole_number
from truearm.kinds import required, text
from truearm.tables.columns import StatedUnits
from truearm.tables.measured_fields import read_fields
from truearm.tables.own_table import keeping
from truearm.tables.reading import read_csv_table, table_from_frame
from truearm.tables.row_fields import CONTENT, LATER, OPTIONAL, PER_ROW, as_field
from truearm.tables.same_tables import identities, told_apart
from truearm.types import Floats, Texts

GROUPS_SHOWN: Final = 3


@keeping("features")
@dataclass(frozen=True, eq=False, repr=False)
class Measurements:
    """n poses of an N-joint arm and what was measured there. SI units; world is the device's frame.

    `read_csv`, `read_touches`, `read_files`, `from_dataframe` and `concatenate` make one.

    Attributes:
        readings: Joint readings (n, N), rad or m.
        targets: Measured points on the tool, in world (n, T, 3); NaN where a point was not measured.
        orientations: world_from_target as unit quaternions w x y z (n, 4), NaN rows where not
            measured; None where no orientation was measured at all.
        sigma_m: Standard deviation of a coordinate of the position (n,), NaN where not stated; None where
            never. Where it is stated along axes, their root mean square.
        group: Name of the set-up (n,), hence which world_from_base and which tool.
        features: All other numeric columns (n, ...), indexed from 0: a copy. To change them, give others:
            `dataclasses.replace(data, features=table)`.
        sources: File of each row (n,).
        rows: Number of each row in its file (n,), the first data row being 1.
        joint_units: Unit of each joint column in the file: "rad", "deg", "m", "mm", or "" where
            nothing stated one and SI was assumed.
        distance_m: Measured distance (n,), NaN where there is none; None where never. From target 1
            to the fixed point `anchor`, or to target 1 of the other row of the same `pair`.
        anchor: Name of the fixed point (n,), "" where there is none.
        pair: Name of the pair of rows (n,), "" where there is none.
        purpose: What each pose was planned for (n,), such as "train" or "validate"; None where nothing says.
        notices: What was noticed on reading.
        default_group: What the set-up is called after its file (n,), "" where a column names it; None where
            nothing is called so.
        tables: Number of the table that each row was read from (n,), made of what the table held; None where
            it is not asked for, as no set-up is called after a file.
        sigma_axes_m: Standard deviations of the position along x, y and z of world (n, 3), NaN rows where
            they are not stated one by one; None where never.
        sigma_rad: Standard deviation of each component of the orientation (n,), NaN where not stated; None
            where never.

    Raises:
        InputError: If a field holds no such values, has another shape, or rows for other poses.
    """

    readings: Floats
    targets: Floats
    orientations: Floats | None
    sigma_m: Floats | None
    group: Texts
    features: pd.DataFrame
    sources: Texts
    rows: NDArray[np.int64]
    joint_units: tuple[str, ...] = ()
    distance_m: Floats | None = None
    anchor: Texts | None = None
    pair: Texts | None = None
    purpose: Texts | None = None
    notices: tuple[Notice, ...] = ()
    default_group: Texts | None = None
    tables: NDArray[np.int64] | None = None
    sigma_axes_m: Floats | None = None
    sigma_rad: Floats | None = None

    def __post_init__(self) -> None:
        self._freeze()
        if not self.joint_units:
            object.__setattr__(self, "joint_units", ("",) * self.joint_count)
        if self.tables is None and self.default_group is not None:
            object.__setattr__(self, "tables", read_only(identities(self)))

    def _freeze(self) -> None:
        """Check that arrays and features have a row for each pose, and make them own and read-only."""
        for name in PER_ROW:
            value = getattr(self, name)
            if value is not None or name not in OPTIONAL:
                array = as_field(name, value)
                object.__setattr__(self, name, read_only(array))
                self._check_length(name, array)
        check_columns(required(self.features, pd.DataFrame, "the table of features"), where="features")
        self._check_length("features", self.features)
        object.__setattr__(self, "features", self.features.reset_index(drop=True))

    def __len__(self) -> int:
        return len(self.readings)

    def __repr__(self) -> str:
        counts = [(len(self), "row"), (self.joint_count, "joint"), (self.target_count, "target")]
        size = ", ".join(f"{count} {noun}{'' if count == 1 else 's'}" for count, noun in counts)
        return f"<Measurements: {size}; {list_names(self.groups[:GROUPS_SHOWN])}>"

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def _check_length(self, name: str, value: Texts | Floats | pd.DataFrame) -> None:
        if len(value) != len(self):
            raise InputError(f"{len(value)} rows", where=name, rule=f"There are {len(self)} readings")

    @property
    def joint_count(self) -> int:
        """Number of joints, N."""
        return int(self.readings.shape[1])

    @property
    def target_count(self) -> int:
        """Number of measured points on the tool, T; 0 where only distances were measured."""
        return int(self.targets.shape[1])

    @property
    def groups(self) -> list[str]:
        """Names of the set-ups, in order of appearance."""
        return list(dict.fromkeys(self.group.tolist()))

    @property
    def files(self) -> list[str]:
        """The files the rows came from, in order of appearance."""
        return list(dict.fromkeys(self.sources.tolist()))

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many rows came from each file."""
        return tuple(int((self.sources == file).sum()) for file in self.files)

    @property
    def stated_sigma_m(self) -> Floats:
        """What each row states as its standard deviation (n,), zero where it states none."""
        return np.zeros(len(self)) if self.sigma_m is None else np.nan_to_num(self.sigma_m)

    @property
    def oriented(self) -> NDArray[np.bool_]:
        """Mask (n,) of the rows that hold an orientation."""
        if self.orientations is None:
            return np.zeros(len(self), dtype=np.bool_)
        return np.asarray(np.isfinite(self.orientations).all(axis=1))

    @classmethod
    def read_csv(
        cls,
        path: str | Path,
        *,
        length_unit: str | None = None,
        angle_unit: str | None = None,
        joint_count: int | None = None,
        joints: Sequence[str] | None = None,
    ) -> "Measurements":
        """Read a CSV file: UTF-8, a header line, commas between fields, points as decimal marks.

        Args:
            path: The file.
            length_unit: "m" or "mm" for lengths whose column names no unit; m by default.
            angle_unit: "rad" or "deg" for joint columns that name no unit; rad by default.
            joint_count: Number of joints that the file must have.
            joints: Kind of each joint, such as robot.joints; tells which columns are lengths.

        Raises:
            InputError: If the file is no such CSV, columns are missing, or values break a rule.
            UsageError: If a unit or a kind of joint is not known.
        """
        stated = StatedUnits(length_unit, angle_unit, joints)
        read = cls._read(as_path(path), stated)
        read.require_joint_count(joint_count if joints is None else stated.joint_count)
        return read

    @classmethod
    def read_touches(
        cls,
        path: str | Path,
        *,
        length_unit: str | None = None,
        angle_unit: str | None = None,
        joints: Sequence[str] | None = None,
    ) -> "Measurements":
        """As read_csv, of a file that may hold readings alone: what was touched is the same in all rows.

        Raises:
            InputError: As for read_csv.
            UsageError: As for read_csv.
        """
        stated = StatedUnits(length_unit, angle_unit, joints)
        file = as_path(path)
        read = cls(
            **read_fields(read_csv_table(file), stated, default_group=name_in_text(file.stem), measured=False)
        )
        read.require_joint_count(stated.joint_count)
        return read

    @classmethod
    def read_files(
        cls,
        paths: str | Path | Sequence[str | Path],
        *,
        length_unit: str | None = None,
        angle_unit: str | None = None,
        joints: Sequence[str] | None = None,
    ) -> "Measurements":
        """Read several CSV files and put them together; each without a `group` column is a group of its own.

        Groups are named after their files, with the folders where two such files have the same name, and a
        `group` column of another file that says such a name means that set-up.

        Args:
            paths: The files, or one.
            length_unit: As for read_csv.
            angle_unit: As for read_csv.
            joints: As for read_csv.

        Raises:
            InputError: As for read_csv, and as for concatenate.
            UsageError: As for read_csv, and if a file is named twice.
        """
        files = [as_path(path) for path in ([paths] if isinstance(paths, str | Path) else paths)]
        places = [os.path.realpath(path) for path in files]
        for path, place in zip(files, places, strict=True):
            if places.count(place) > 1:
                raise UsageError("the file is named twice", where=str(path))
        stated = StatedUnits(length_unit, angle_unit, joints)
        parts = [cls._read(path, stated) for path in files]
        for part in parts:
            part.require_joint_count(stated.joint_count)
        return cls.concatenate(parts)

    @classmethod
    def _read(cls, path: Path, stated: StatedUnits) -> "Measurements":
        return cls(**read_fields(read_csv_table(path), stated, default_group=name_in_text(path.stem)))

    @classmethod
    def from_dataframe(
        cls,
        frame: pd.DataFrame,
        *,
        name: str = "data",
        length_unit: str | None = None,
        angle_unit: str | None = None,
        joints: Sequence[str] | None = None,
    ) -> "Measurements":
        """Measurements from a DataFrame with the columns of a measurement file.

        Args:
            frame: The table; NaN says that nothing was measured.
            name: Stands for the file in messages, and names the group where there is no such column.
            length_unit: As for read_csv.
            angle_unit: As for read_csv.
            joints: As for read_csv.

        Raises:
            InputError: If columns are missing or values break a rule.
            UsageError: As for read_csv, and if it is no DataFrame.
        """
        required(frame, pd.DataFrame, "the table")
        if len(frame) == 0:
            raise InputError("there are no data rows", where=name)
        stated = StatedUnits(length_unit, angle_unit, joints)
        table = table_from_frame(frame, where=text(name, "name"))
        read = cls(**read_fields(table, stated, default_group=name))
        read.require_joint_count(stated.joint_count)
        return read

    @staticmethod
    def concatenate(parts: Sequence["Measurements"]) -> "Measurements":
        """All rows of several measurements, in order.

        Points, orientations and features that a part lacks become NaN. Pairs never reach from one part to
        another. Groups that a column names keep their names: equal names mean the same set-up. Those that
        are called after their file are set-ups of their own, as with `read_files`, and so is the fixed point
        that their distances lead to where nothing names it: files of one name are called by their folders
        as well. Tables of one name are numbered, "data" and "data 2", among the sources whoever names their
        set-ups. Rows that were selected from the same table belong to the same set-up. Tables that were read
        separately, as one that has grown and its earlier state or the rows of a loaded calibration, are one
        set-up only if they share rows.

        Raises:
            InputError: If there are no parts, the numbers of joints differ, or a column names a set-up as
                several files are called whose set-ups no column names.
        """
        return _concatenate([required(part, Measurements, "the measurements") for part in parts])

    @staticmethod
    def of(given: object) -> "Measurements":
        """`given`, which has to be measurements, or a list of them that are put together by `concatenate`.

        Raises:
            UsageError: If it is anything else.
        """
        parts = given if isinstance(given, Sequence) and not isinstance(given, str) else [given]
        found = [required(part, Measurements, "the measurements") for part in parts]
        return found[0] if len(found) == 1 else _concatenate(found)

    def __getitem__(self, index: ArrayLike | slice) -> "Measurements":
        """As `select`."""
        return self.select(index)

    def select(self, index: ArrayLike | slice) -> "Measurements":
        """The rows of a boolean mask (n,), a slice, or row indices (m,) from 0, negative ones from the end.

        `data[index]` is the same.

        Raises:
            InputError: If it is none of these, or a row is none of these measurements.
        """
        chosen = as_row_numbers(index, len(self))
        changes = {name: getattr(self, name)[chosen] for name in PER_ROW if getattr(self, name) is not None}
        return replace(self, **changes, features=self.features.iloc[chosen].reset_index(drop=True))

    def identical_rows(self) -> NDArray[np.bool_]:
        """Mask (n,) of the rows equal to an earlier one in everything that was read."""
        return np.asarray(self.content().duplicated(keep="first"))

    def deduplicated(self) -> "Measurements":
        """Without rows that repeat an earlier one in everything that was read."""
        repeated = self.identical_rows()
        return self.select(~repeated) if repeated.any() else self

    def hash(self) -> str:
        """SHA-256 (hexadecimal) of what was measured.

        Row numbers and purposes do not count, and file names only where set-ups are called after them.
        """
        digest = hashlib.sha256()
        for name in CONTENT:
            value = getattr(self, name)
            if value is None and name in LATER:
                continue
            digest.update(f"{name}:{None if value is None else value.shape}:".encode())
            if value is not None:
                is_text = value.dtype.kind == "U"
                digest.update("\n".join(value).encode() if is_text else np.ascontiguousarray(value).tobytes())
        for column, values in self.features.items():
            digest.update(f"{column}:".encode())
            digest.update(np.ascontiguousarray(values, dtype=np.float64).tobytes())
        return digest.hexdigest()

    def seen(self, targets: int | Sequence[int] | None = None) -> NDArray[np.bool_]:
        """Which points each row holds: (n, T), (n, t) of `targets`, indices from 0, or (n,) of one target."""
        points = self.targets if targets is None else self.targets[:, targets]
        return np.asarray(np.isfinite(points).all(axis=-1))

    def most_held(self, among: Sequence[int] | None = None) -> int:
        """Internal: the target, an index from 0, that most rows hold, of all or `among` some."""
        places = list(range(self.target_count)) if among is None else list(among)
        held = self.seen(places).sum(axis=0)
        return places[int(held.argmax())]

    def row_names(self, mask: NDArray[np.bool_]) -> str:
        """Internal: the rows of a mask (n,) in words, by their numbers in their files."""
        chosen = self.select(mask)
        parts = [(file, list_rows(chosen.rows[chosen.sources == file].tolist())) for file in chosen.files]
        if len(self.files) == 1:
            return parts[0][1]
        return "; ".join(f"{rows} of {file}" for file, rows in parts)

    def require_joint_count(self, count: int | None) -> None:
        """Internal: raise InputError unless there are `count` joints; None asks for nothing."""
        if count is not None and self.joint_count != whole_number(count, "joint_count"):
            zero = next((name for name in self.features if re.fullmatch("q0(_[a-z]+)?", str(name))), None)
            raise InputError(
                f"there are {self.joint_count} joint columns",
                where=", ".join(self.files),
                rule=f"The robot has {count_of(count, 'joint')}",
                way_out="Name the robot that was measured, of a URDF as FILE.urdf#BASE,TIP the links that "
                "its joints are between, or correct the columns"
                if zero is None
                else f'Joints are counted from 1: rename "{zero}" and those after it',
            )

    def content(self) -> pd.DataFrame:
        """Internal: all that was read, a column for each number and name, features under their own."""
        columns: dict[str, NDArray[np.generic]] = {}
        for name in CONTENT:
            value = getattr(self, name)
            if value is not None:
                flat = value.reshape(len(self), -1)
                columns |= {f"{name}{k}": flat[:, k] for k in range(flat.shape[1])}
        columns |= {f"feature {name}": values.to_numpy() for name, values in self.features.items()}
        return pd.DataFrame(columns)


def _concatenate(parts: Sequence[Measurements]) -> Measurements:
    if not parts:
        raise InputError("there are no measurements to put together")
    first, parts = parts[0], told_apart(parts)
    for part in parts[1:]:
        if part.joint_count != first.joint_count:
            raise InputError(
                f"{part.joint_count} joints in {part.files[0]}, {first.joint_count} in {first.files[0]}",
                rule="All measurements must be of the same arm",
            )
    sizes = [len(part) for part in parts]
    return Measurements(
        readings=np.concatenate([part.readings for part in parts]),
        targets=_padded_targets(parts),
        orientations=_joined([part.orientations for part in parts], sizes),
        sigma_m=_joined([part.sigma_m for part in parts], sizes),
        group=np.concatenate([part.group for part in parts]),
        features=pd.concat([part.features for part in parts], ignore_index=True),
        sources=np.concatenate([part.sources for part in parts]),
        rows=np.concatenate([part.rows for part in parts]),
        joint_units=_common_units(parts),
        distance_m=_joined([part.distance_m for part in parts], sizes),
        anchor=_joined([part.anchor for part in parts], sizes, ""),
        purpose=_joined([part.purpose for part in parts], sizes, ""),
        pair=_joined([_own_pairs(part, k) for k, part in enumerate(parts)], sizes, ""),
        notices=tuple(notice for part in parts for notice in part.notices),
        default_group=_joined([part.default_group for part in parts], sizes, ""),
        tables=_joined([part.tables for part in parts], sizes, 0),
        sigma_axes_m=_joined([part.sigma_axes_m for part in parts], sizes),
        sigma_rad=_joined([part.sigma_rad for part in parts], sizes),
    )


def _padded_targets(parts: Sequence[Measurements]) -> Floats:
    count = max(part.target_count for part in parts)
    padded = [np.full((len(part), count, 3), np.nan) for part in parts]
    for target, part in zip(padded, parts, strict=True):
        target[:, : part.target_count] = part.targets
    return np.concatenate(padded)


def _joined(
    values: Sequence[NDArray[Any] | None], sizes: Sequence[int], missing: float | str = np.nan
) -> NDArray[Any] | None:
    """A field of all parts, in order, `missing` in the rows of those that lack it; None where all do."""
    row = next((value.shape[1:] for value in values if value is not None), None)
    if row is None:
        return None
    given = zip(values, sizes, strict=True)
    return np.concatenate(
        [np.full((size, *row), missing) if value is None else value for value, size in given]
    )


def _own_pairs(part: Measurements, number: int) -> Texts | None:
    if part.pair is None:
        return None
    return np.array([f"{name}#{number}" if name else "" for name in part.pair], dtype=np.str_)


def _common_units(parts: Sequence[Measurements]) -> tuple[str, ...]:
    """Unit of each joint where all parts state the same, else "" so that the values are looked at."""
    units = zip(*(part.joint_units for part in parts), strict=True)
    return tuple(unit[0] if len(set(unit)) == 1 else "" for unit in units)
