"""`truearm import`: other people's tables as measurement files."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from truearm.cli import import_options as option
from truearm.cli.arguments import AsJson
from truearm.cli.console import print_json, say_wrapped, suggest, warn
from truearm.errors import UsageError, count_of, in_json, typed
from truearm.files import check_output, write_whole
from truearm.units import COLUMN_ANGLE_UNITS, COLUMN_LENGTH_UNITS

if TYPE_CHECKING:
    from truearm.importing import Imported

DELIMITER_WORDS = {"tab": "\t", "\\t": "\t", "comma": ",", "semicolon": ";", "space": " "}


def command(
    raw: option.Raw,
    output: option.Output,
    columns: option.Columns = None,
    keep: option.Keep = None,
    rotation: option.Rotation = None,
    joint_unit: option.JointUnit = None,
    length_unit: option.LengthUnit = None,
    second: option.Second = None,
    on: option.On = None,
    names: option.Names = None,
    delimiter: option.Delimiter = None,
    decimal: option.Decimal = None,
    skip_lines: option.SkipLines = 0,
    sheet: option.Sheet = None,
    with_names: option.WithNames = None,
    with_delimiter: option.WithDelimiter = None,
    with_decimal: option.WithDecimal = None,
    with_skip_lines: option.WithSkipLines = None,
    with_sheet: option.WithSheet = None,
    with_encoding: option.WithEncoding = None,
    comment: option.Comments = None,
    missing: option.Missing = None,
    encoding: option.Encoding = "utf-8",
    as_json: AsJson = False,
) -> None:
    """Write a measurement file in rad and m from a table with other columns, units or marks.

    Nothing is guessed: what is not plain CSV in our columns and units has to be stated.

    Examples:
      truearm import raw.csv -o m.csv --joint-unit deg --length-unit mm
      truearm import raw.txt -o m.csv --map q1=J1:deg --map x=px:mm
      truearm import joints.csv --with tracker.csv --on point -o m.csv
      truearm import raw.txt -o m.csv --columns x,y,z,-,q1,q2,q3,q4,q5,q6
      truearm import book.xlsx --sheet "Day 2" -o m.csv --joint-unit deg
    """
    from truearm.importing import ImportPlan, import_table
    from truearm.tables.raw_tables import Marks
    from truearm.tables.rotation_columns import RotationColumns

    stated = (with_names, with_delimiter, with_decimal, with_skip_lines, with_sheet, with_encoding)
    other = _other(second or [], asked=any(mark is not None for mark in stated))
    check_output(output, raw, other)
    marks = Marks(
        _delimiter(delimiter, "--delimiter"),
        decimal,
        skip_lines,
        tuple(comment or ()),
        tuple(missing or ()),
        encoding,
        _names(names),
        sheet,
    )
    second_marks = replace(
        marks,
        names=_names(with_names),
        delimiter=_delimiter(with_delimiter, "--with-delimiter") or marks.delimiter,
        decimal=with_decimal or decimal,
        skip_lines=skip_lines if with_skip_lines is None else with_skip_lines,
        sheet=with_sheet,
        encoding=with_encoding or encoding,
        options="--with-",
    )
    plan = ImportPlan(
        columns=_pairs(columns or [], "--map"),
        keep=_pairs(keep or [], "--keep"),
        rotation=RotationColumns.parse(rotation) if rotation else None,
        joint_unit=joint_unit,
        length_unit=length_unit,
        marks=marks,
        second=other,
        second_marks=second_marks,
        on=on,
    )
    imported = import_table(raw, plan)
    write_whole(output, imported.frame.to_csv(index=False, lineterminator="\n"))
    _tell(imported, output, as_json=as_json)


def _other(second: list[Path], *, asked: bool) -> Path | None:
    """The second table, None without one; `asked` tells whether it is said how it is written."""
    if len(second) > 1:
        raise UsageError("more than two tables", where="--with", rule="Two are joined")
    if asked and not second:
        raise UsageError("there is one table only", where="--with-...", way_out="Name the other: --with FILE")
    return second[0] if second else None


def _names(text: str | None) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",")) if text is not None else ()


def _tell(imported: "Imported", output: Path, *, as_json: bool) -> None:
    frame, unused, left_out, remarks, notices = imported
    warn(notices)
    if as_json:
        names = [str(name) for name in frame.columns]
        said = {"output": str(output), "rows": len(frame), "columns": names}
        print_json(
            {
                **said,
                "left_out": unused,
                "rows_left_out": left_out,
                "remarks": remarks,
                "notices": in_json(notices),
            }
        )
        return
    say_wrapped(f"{output}: {count_of(len(frame), 'row')}, {', '.join(frame.columns)}.")
    if unused:
        say_wrapped(f"Left out: {', '.join(unused)}. Keep them with --keep.")
    for what in (*left_out, *remarks):
        say_wrapped(f"Left out: {what}.")
    suggest(f"truearm calibrate ROBOT {typed(output)} -o result")


def _pairs(options: list[str], option: str) -> dict[str, str]:
    """OURS=THEIRS by OURS; without "=" both are the same but for the unit."""
    pairs: dict[str, str] = {}
    for text in options:
        ours, mark, theirs = text.partition("=")
        if not mark and option == "--keep":
            name, _, unit = text.rpartition(":")
            known = COLUMN_LENGTH_UNITS + COLUMN_ANGLE_UNITS
            ours, theirs = name if name and unit in known else text, text
        if not ours or not theirs:
            raise UsageError(f'"{text}" is no pair of columns', where=option, rule="Write OURS=THEIRS")
        if ours in pairs:
            raise UsageError(f'column "{ours}" is named twice', where=option)
        pairs[ours] = theirs
    return pairs


def _delimiter(text: str | None, option: str) -> str | None:
    if text is None:
        return None
    mark = DELIMITER_WORDS.get(text, text)
    if len(mark) != 1:
        from truearm.tables.reading import quoted_delimiter

        raise UsageError(
            f'"{text}" is no delimiter',
            where=option,
            rule=f"One mark, such as {quoted_delimiter(';')} or tab",
        )
    return mark
