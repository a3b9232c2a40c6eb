"""Rows of an update without those that no other row supports."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.updating.estimating import begun, estimate
from truearm.updating.scattering import Scatter
from truearm.updating.scene import Scene, State
from truearm.updating.unsupported import unsupported

MOST_OUTLIERS: Final = 0.2


@dataclass(frozen=True, eq=False)
class JudgedRows:
    """Measurements, where the search for what moved begins, and how an unchanged arm may scatter there."""

    scene: Scene
    start: State
    scatter: Scatter

    @classmethod
    def of(cls, whole: Scene) -> "JudgedRows":
        """All rows of a scene."""
        scene, start = begun(whole)
        return cls(scene, start, Scatter(scene.covariance(start)))

    @property
    def visit_by_visit(self) -> "JudgedRows":
        """The same, with visits to a pose that vouch for one another as poses do."""
        scene = self.scene.visit_by_visit
        return (
            self
            if scene is self.scene
            else JudgedRows(scene, self.start, Scatter(scene.covariance(self.start)))
        )


def without_outliers(calibration: Calibration, all_rows: JudgedRows) -> tuple[JudgedRows, list[int]]:
    """Rows without those that no other row supports, the worst one taken out first; and these.

    Where they would be too many, it is not the rows that are wrong: all are kept.
    """
    whole, rows = all_rows.scene, all_rows
    std, free = whole.unknowns.std, whole.unknowns.free
    kept, out = np.arange(len(whole.data)), list[int]()
    most = int(MOST_OUTLIERS * len(whole.data))
    while True:
        judged = rows.visit_by_visit
        found = estimate(judged.scene, judged.scatter, judged.start, free)
        alone = unsupported(found, std, free, most + 1 - len(out))
        if not alone:
            return rows, out
        out += kept[alone].tolist()
        if len(out) > most:
            return all_rows, []
        kept = np.delete(kept, alone)
        rows = JudgedRows.of(Scene(whole.task, whole.data.select(kept), calibration, whole.unknowns))
