"""Ways of arm and table from one place to the next on which they do not meet, under nominal kinematics."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from truearm.cell.cell_file import Cell
from truearm.cell.clearance import Clearance
from truearm.cell.device_errors import RefusedError
from truearm.cell.reading import Expected
from truearm.cell.table_panel import TablePanel
from truearm.types import Floats

# How far the table goes down at first to let the arm pass; if that does not help, as far as it can.
DEPTHS_M: Final = (0.03, 0.1)
LEAVES_WITHIN_M: Final = 1e-6


class Way(NamedTuple):
    """How arm and table get to where a target is measured.

    Attributes:
        arm: Readings (N,) that the arm goes through, one after another.
        over: Places (3,) that the carriage goes to before, m; None where both go at the same time.
        waits: Whether the carriage is in its place before the arm comes, and not after it.
    """

    arm: list[Floats]
    over: list[Floats] | None
    waits: bool = False


class Ways:
    """A table moves together with the arm where they cannot meet on the way.

    Else one of them goes first. If that does not help the table goes out of the way, no farther than it has
    to, and comes when the arm is there; and if that does not help either, the arm goes by a refuge, where it
    was at first.
    """

    def __init__(self, cell: Cell, table: TablePanel) -> None:
        self._table, self._together = table, cell.file.process.together
        self._clearance = Clearance(cell.arm, cell.flange_from_target, table.panel, cell.file.clearance)

    def to(
        self,
        way: list[Floats],
        expected: Expected,
        *,
        here: Floats,
        carriage: Floats,
        refuge: Floats,
        world_from_base: Floats,
    ) -> Way:
        """The first way on which arm and table keep apart.

        Args:
            way: Readings (N,) that the arm has to go through.
            expected: Where the target will be.
            here: Where the arm is (N,).
            carriage: Where the carriage is (3,), m.
            refuge: Where the arm may go first (N,).
            world_from_base: Where the base stands (4, 4) in the frame of the table.

        Raises:
            RefusedError: If there is none, or the table cannot be there.
        """
        end = self._table.carriage_for(expected)
        direct = np.array([carriage, end])

        def apart(arm: Floats, carriages: Floats) -> bool:
            return self._clearance.margin(arm, carriages, world_from_base) > expected.radius_m

        for found in self._possible(way, carriage, end, refuge):
            arm = np.array([here, *found.arm])
            if found.over is None:
                if apart(arm, direct):
                    return found
                continue
            before = np.array([carriage, *found.over, end] if found.waits else [carriage, *found.over])
            stays, comes = before[-1:], np.array([before[-1], end])
            if not (apart(arm, stays) and (found.waits or apart(arm[-1:], comes))):
                continue
            if (
                len(before) == 1
                or apart(arm[:1], before)
                or self._leads_away(arm[:1], before, world_from_base)
            ):
                return found
        raise RefusedError("link or tool would meet the table on every way there", where="the arm")

    def _leads_away(self, arm: Floats, by: Floats, world_from_base: Floats) -> bool:
        """Whether a table that stands too near an arm (1, N) only leaves it by a way (p, 3).

        An arm that went too far may be there, and nothing else could part them.
        """
        now = self._clearance.margin(arm, by[:1], world_from_base)
        return self._clearance.margin(arm, by, world_from_base) > now - LEAVES_WITHIN_M

    def _possible(self, way: list[Floats], carriage: Floats, end: Floats, refuge: Floats) -> Iterator[Way]:
        """Ways to try, the quickest first."""
        if self._together:
            yield Way(way, None)
        yield Way(way, [])
        yield Way(way, [], waits=True)
        for depth in DEPTHS_M:
            yield Way(way, [self._table.lowered(carriage, depth)])
        low = self._table.released(carriage)
        yield Way(way, [low])
        yield Way(way, [low, self._table.released(end)])
        roundabout = [refuge, *way]
        if self._together:
            yield Way(roundabout, None)
        yield Way(roundabout, [low])
