"""What a report is made from: the calibration, and what several of its chapters work out of it once."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from truearm._core import Field
from truearm.calibration import Calibration
from truearm.description.one_turn import one_turn
from truearm.doubts.at_once import STEP_KINDS
from truearm.doubts.few_judged import UNDECIDED, FewJudged
from truearm.doubts.grids import grid_steps, grid_words
from truearm.doubts.moved_words import TAKEN_FOR_NOISE
from truearm.doubts.of_results import ON_A_GRID, SINGLE_ROWS, helps, nothing_to_gain
from truearm.doubts.outliers import NO_OUTLIERS, Outliers, judged_means_mm
from truearm.evaluation import Evaluation
from truearm.fits.models import NOMINAL, ArmModel
from truearm.fits.stillness import still_warning
from truearm.judgement.held_rows import HeldRows
from truearm.reporting.numbers import listed, shown_readings, significant, unit_of
from truearm.reporting.waypoints import Waypoints
from truearm.storage.summary import WAVE, distance_at_floor_mm
from truearm.types import Floats
from truearm.units import MM_PER_METRE

OUTER: Final = 0.01
"""Share of the readings on either side that a joint's usual range leaves out."""
DRAWN_FOR_TYPICAL: Final = 0
ROWS: Final = "rows"


@dataclass(frozen=True, eq=False)
class Facts:
    """A calibration, and measurements it was judged on besides.

    Attributes:
        calibration: What is reported.
        other: Its errors on other measurements; None where there are none.
        other_names: Files of these.
    """

    calibration: Calibration
    other: Evaluation | None = None
    other_names: tuple[str, ...] = ()

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The content of summary.json: the one source of figures."""
        return self.calibration.summary

    @property
    def held(self) -> HeldRows | None:
        """The held-out rows with errors that belong to their poses; None without, and where distances, which
        two poses have, were measured.
        """
        return None if self.calibration.selection.distances else self.calibration.held

    @property
    def update(self) -> Mapping[str, Any] | None:
        """What the update said that this calibration comes from; None where there was none."""
        revision = self.calibration.revision
        return None if revision is None else revision.report

    @property
    def judged(self) -> str:
        """What the poses that errors are of are called: "held-out", or "left-out" after an update."""
        return self.calibration.validation.judged

    @property
    def poses_judged(self) -> str:
        """How many they are: "832 held-out poses", or "36 held-out distances"."""
        return self.calibration.validation.poses_judged

    @property
    def those_judged(self) -> str:
        """What errors are of: "held-out poses" or "held-out distances"."""
        return f"{self.judged} {'distances' if self.calibration.selection.distances else 'poses'}"

    @property
    def counted(self) -> str:
        """What single errors are of: "poses", or "rows" where some poses were measured several times."""
        validation = self.calibration.validation
        return "poses" if validation.n_holdout_poses == validation.n_holdout else ROWS

    @property
    def error(self) -> str:
        """What errors are of: "distance error" or "position error"."""
        return f"{self.calibration.selection.errors_of} error"

    @property
    def point_name(self) -> str:
        """What `point` is called in sentences."""
        if not self.calibration.selection.distances:
            return "measured point"
        return "robot file's tool" if self.names_tool else "flange"

    @property
    def names_tool(self) -> bool:
        """Whether the robot file names a tool."""
        return not np.array_equal(self.calibration.robot.tool, np.eye(4))

    @cached_property
    def without_waves(self) -> ArmModel:
        """The model that predicts, but for waves: they are finer than a curve over a joint can show."""
        model = self.calibration.model
        if model.field is None:
            return model
        blocks = [block for block in model.field.blocks() if block["name"] != WAVE]
        inputs, parameters = model.field.input_count, model.field.parameter_count
        return replace(model, field=Field(inputs, parameters, blocks, self.calibration.arm.flange_chain))

    def waves(self, joint: int) -> list[dict[str, Any]]:
        """The blocks of the summary that are waves of a joint, from 0."""
        blocks = self.summary["blocks"]
        return [block for block in blocks if block["name"] == WAVE and block["joints"] == [joint + 1]]

    @property
    def models(self) -> list[str]:
        """Names of the models, the plainest first."""
        return list(self.calibration.models)

    @property
    def best(self) -> str:
        """Name of the model that predicts."""
        return self.calibration.model_name

    @cached_property
    def errors_mm(self) -> Mapping[str, Floats]:
        """Lengths of the held-out errors of each model (n,), mm, NaN where not measured."""
        known = self.calibration.held
        if known is None:
            return {}
        return {name: MM_PER_METRE * found.distance_m for name, found in known.errors.items()}

    @property
    def files(self) -> tuple[str, ...]:
        """Of the measurements; none where rows were left out of the file."""
        return () if self.calibration.rows is None else tuple(self.calibration.rows.data.files)

    @cached_property
    def outliers(self) -> Outliers:
        """Rows that are far off; none after an update, which leaves its own out."""
        return NO_OUTLIERS if self.update is not None else Outliers.of(self.calibration)

    @property
    def is_spoilt_by_rows(self) -> bool:
        """Whether the calibration helps but for single rows that are far off."""
        return bool(self.noticed(SINGLE_ROWS))

    @property
    def is_of_no_help(self) -> bool:
        """Whether the calibration is wrong, so that nothing it says of noise or of the arm holds."""
        before, after = self.mean_mm(NOMINAL), self.mean_mm()
        told = helps(before, after) or self.gains_nothing or self.is_spoilt_by_rows
        return not (told or self.undecided)

    @property
    def undecided(self) -> str:
        """That so few poses were judged that they do not tell whether the calibration helps; else empty."""
        validation, before, after = self.calibration.validation, self.mean_mm(NOMINAL), self.mean_mm()
        few = FewJudged(
            self.calibration.held, validation.n_holdout_poses, self.judged, self.best, self.outliers
        )
        if self.update is None:
            return few.words if self.noticed(UNDECIDED) else ""
        told = helps(before, after) or self.gains_nothing or not few.may_be_chance(after)
        return "" if told else few.words

    @property
    def gains_nothing(self) -> bool:
        """Whether it leaves no less than the nominal model, of data that are hardly wrong."""
        return nothing_to_gain(self.mean_mm(NOMINAL), self.mean_mm(), self.floor_mm)

    @cached_property
    def floor_mm(self) -> float:
        """Mean position error of what the model leaves, mm: noise and, unless it is variable, what varies."""
        return distance_at_floor_mm(self.calibration)

    @property
    def train_mean_mm(self) -> float:
        """Mean position error of the model that predicts, on the rows it was trained with, mm."""
        return self.calibration.validation.train[self.best].position.mean

    @property
    def leaves_outliers_out(self) -> bool:
        """Whether errors are told without outliers too: some judged poses are, and the others tell so."""
        return bool(self.outliers.means_mm) and not self.is_of_no_help

    @property
    def mean_error(self) -> str:
        """What `mean_mm` is called."""
        return "mean error without the outliers" if self.leaves_outliers_out else "mean error"

    def mean_mm(self, model: str | None = None) -> float:
        """Mean held-out error of a model, the best by default, mm; outliers are no part of it."""
        name = model or self.best
        if self.calibration.held is None:
            return judged_means_mm(self.calibration.validation, self.outliers)[name]
        return float(np.nanmean(self.kept_errors_mm(name)))

    def kept_errors_mm(self, model: str) -> Floats:
        """Lengths of held-out errors of a model (k,), mm, without outliers; none where rows are not known."""
        known = self.calibration.held
        if known is None:
            return np.empty(0)
        found = self.errors_mm[model]
        kept = found[known.without(self.summary["outliers"])]
        return kept if np.isfinite(kept).any() else found

    @property
    def joints(self) -> tuple[str, ...]:
        """Kind of each joint."""
        return self.calibration.robot.joints

    def unit(self, joint: int) -> str:
        """Unit that a joint is shown in; joints count from 0."""
        return unit_of(self.joints[joint])

    def shown(self, readings: Floats) -> Floats:
        """Readings (n, N) in deg and mm."""
        return shown_readings(readings, self.joints)

    def shown_of(self, joint: int, values: Floats) -> Floats:
        """Values (n,) of one joint, from 0, in deg or mm."""
        return np.asarray(shown_readings(values[:, None], self.joints[joint : joint + 1])[:, 0])

    @cached_property
    def readings(self) -> Floats | None:
        """Readings (n, N) that the calibration was fitted to; None where they were left out of the file."""
        rows = self.calibration.learned_from
        return None if rows is None else rows.data.readings

    @cached_property
    def grids(self) -> str:
        """What stood on which grid, in words; empty where nothing did, or neither rows nor notices tell."""
        if self.readings is None:
            return "readings on a grid" if self.noticed(ON_A_GRID) else ""
        steps = grid_steps(self.readings, self.joints)
        return grid_words(steps, self.joints) if steps else ""

    @cached_property
    def waypoints(self) -> Waypoints | None:
        """The measured poses as waypoints; None of schemes, and where rows were left out of the file."""
        return Waypoints.of(self)

    @property
    def mostly_refused(self) -> str:
        """That compensation refuses most measured poses, and why, in words; empty where it does not."""
        return "" if self.waypoints is None else self.waypoints.mostly_refused

    def noticed(self, kind: str) -> str:
        """The calibration's notice of a kind; empty where there is none."""
        return next((str(notice) for notice in self.calibration.notices if notice.kind == kind), "")

    @property
    def changed_meanwhile(self) -> bool:
        """Whether something stood otherwise from some measured row on."""
        return any(map(self.noticed, STEP_KINDS))

    @property
    def leaves_more_than_noise(self) -> bool:
        """Whether more than noise is told as noise: what moved, slipped, or is stated as sigma."""
        return any(map(self.noticed, TAKEN_FOR_NOISE))

    @cached_property
    def still(self) -> str:
        """What is to be known of joints that stood still; empty where none did, or the rows are not known."""
        return "" if self.readings is None else still_warning(self.readings, self.joints)

    @cached_property
    def features(self) -> dict[str, float]:
        """A usual value of each feature: the median of the rows, zero where they are not known."""
        names = self.calibration.options.features
        rows = self.calibration.learned_from if names else None
        if rows is None:
            return dict.fromkeys(names, 0.0)
        return {name: float(rows.data.features[name].median()) for name in names}

    @property
    def at_features(self) -> str:
        """A sentence, after a blank, on the features that hold where none is named; empty without."""
        if not self.features:
            return ""
        if self.readings is None:
            return (
                f" Features ({listed([*self.features])}) are zero: their values were left out of this file."
            )
        values = [f"{name} = {significant(value)}" for name, value in self.features.items()]
        return f" Where nothing else is said, features are at the medians of the rows: {listed(values)}."

    @cached_property
    def point(self) -> Floats:
        """The measured point that errors are judged at, in the flange frame (3,), m; the tool's otherwise."""
        targets = self.calibration.model.setup.targets
        if self.calibration.selection.distances or targets.shape[1] == 0:
            return self.calibration.robot.tool[:3, 3]
        return np.asarray(self.calibration.measured.points(targets)[0])

    @cached_property
    def span(self) -> Floats:
        """Range of each joint (N, 2): that of the rows but for a percent on either side, else its limits."""
        if self.readings is not None:
            return np.quantile(self.readings, [OUTER, 1.0 - OUTER], axis=0).T
        return self.within_a_turn

    @cached_property
    def within_a_turn(self) -> Floats:
        """Range of each joint (N, 2): its limits and a turn at the most, or what was measured."""
        low, high = one_turn(self.calibration.robot)
        if self.readings is not None:
            low = np.minimum(low, self.readings.min(axis=0))
            high = np.maximum(high, self.readings.max(axis=0))
        return np.stack([low, high], axis=1)

    @cached_property
    def typical(self) -> Floats:
        """A usual pose (N,): the row nearest to the middle of all, or the middle of the joints' ranges."""
        middle = np.asarray(self.span.mean(axis=1))
        if self.readings is None:
            return middle
        centre = np.median(self.readings, axis=0)
        width = np.maximum(np.ptp(self.readings, axis=0), 1e-9)
        return np.asarray(self.readings[np.argmin(np.square((self.readings - centre) / width).sum(axis=1))])

    def places(self, joint: int, count: int) -> Floats:
        """Readings of one joint (count,) from end to end of its turn."""
        low, high = self.within_a_turn[joint].tolist()
        return np.linspace(low, high, count)

    def drawn(self, count: int) -> Floats:
        """Some poses (m, N) that stand for all: rows, or drawn within the joints' ranges."""
        if self.readings is not None:
            return np.asarray(self.readings[:count])
        low, high = self.span.T
        drawn = np.random.default_rng(DRAWN_FOR_TYPICAL).uniform(low, high, (count, len(low)))
        return np.asarray(drawn)

    def inputs(self, readings: Floats) -> Floats:
        """Inputs (n, I) of the field at readings (n, N)."""
        columns = np.tile(list(self.features.values()), (len(readings), 1))
        return np.hstack([self.calibration.robot.joints_from_readings(readings), columns])
