"""Values of a table's columns in SI, and rows that hold none that can be."""

from truearm.errors import InputError, list_rows
from truearm.tables.columns import Column
from truearm.tables.reading import Table
from truearm.types import Floats, Mask
from truearm.units import to_si


def si_values(table: Table, column: Column) -> Floats:
    """Values (n,) of a column in rad or m; as they are where it has no unit."""
    values = table.numbers(column.name)
    return to_si(values, column.unit) if column.unit else values.copy()


def refuse_rows(
    table: Table, bad: Mask, what: str, rule: str, way_out: str = "Correct or remove the rows"
) -> None:
    """Raise InputError that names the rows of a mask (n,) if there are any."""
    if bad.any():
        rows = list_rows(table.row_numbers[bad].tolist())
        raise InputError(f"{what} {rows}", where=table.where, rule=rule, way_out=way_out)
