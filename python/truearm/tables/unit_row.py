"""The row of units that instruments and spreadsheets write below the names of the columns."""

from truearm.tables.reading import Table, holds_units
from truearm.units import HEADER_UNITS, bare_unit


def without_unit_row(table: Table) -> tuple[Table, dict[str, str]]:
    """The table without a first row that holds units and nothing else, and the unit of each column there.

    Units are those of HEADER_UNITS, "" where the row says none of these. Where another row is all that there
    is, or the first holds anything else, the table comes back as it was.
    """
    first = {name: table.cells(name)[0] for name in table.names}
    if table.row_count == 1 or not holds_units(first.values()):
        return table, {}
    rest = {name: column[1:] for name, column in table.columns.items()}
    units = {name: HEADER_UNITS.get(bare_unit(cell), "") for name, cell in first.items()}
    return Table(table.where, rest, table.row_count - 1, table.remarks), units
