"""What the paper states, beside what comes out here."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from truearm._core import Network, independent_columns
from truearm.fits.identified import IdentifiedArm
from truearm.fits.parameters import ALPHA, BETA, A, D
from truearm.planning.dividing import named_columns
from truearm.simulation import PAPER_PARAMETERS, VirtualArm
from truearm.studies.schemes import NETWORK
from truearm.studies.setting import CELLS, MEMBERSHIPS, space_of

Result = Mapping[str, Any]

SIZES: Final = ("mean_mm", "max_mm")


@dataclass(frozen=True)
class Statement:
    """A sentence of the paper and its check.

    Attributes:
        place: Section or figure.
        paper: What it says, in our words.
        figures: Results that the check needs, with blanks between; empty for none.
        check: From the results: what comes out here, and whether it agrees; None where they are of another
            size than what the paper speaks of.
    """

    place: str
    paper: str
    figures: str
    check: Callable[[Result], tuple[str, bool | None]]


def checked(result: Result) -> list[dict[str, Any]]:
    """Each statement whose figures were run: place, paper, ours and whether they agree."""
    found = []
    for statement in STATEMENTS:
        if not set(statement.figures.split()) <= set(result):
            continue
        ours, agrees = statement.check(result)
        found.append({"place": statement.place, "paper": statement.paper, "ours": ours, "agrees": agrees})
    return found


def _of(result: Result, *keys: str) -> dict[str, float]:
    found: Any = result
    for key in keys:
        found = found[key]
    return dict(found)


def _median(result: Result, *keys: str) -> float:
    return float(_of(result, *keys)["median"])


def _observable(_: Result) -> tuple[str, bool]:
    """The rank of 25 parameters: BASE, A1 to A3 and FLANGE, with joints 4 and 5 at zero."""
    arm, base = VirtualArm.paper(), IdentifiedArm(VirtualArm.paper().robot, "world")
    values = arm.poses(200, held=(4, 5))
    chain = base.chain(arm.robot.flange @ arm.robot.tool)
    jacobian, tool = chain.parameter_jacobian(values), chain.pose(values)[:, :3, :3]
    # FLANGE moves the tool point by theta along y, d along z, a along x, by alpha and beta not at all.
    flange = np.concatenate([tool[:, :, [1, 2, 0]], np.zeros_like(tool[:, :, :2])], axis=2)
    columns = [*range(20), D, D, A, ALPHA, BETA]
    rank = len(independent_columns(np.concatenate([jacobian[:, :, :20], flange], axis=2), columns))
    chosen = named_columns(base, PAPER_PARAMETERS)
    own = len(independent_columns(jacobian[:, :, chosen], chosen))
    return f"rank {rank} of 25; the named ones have rank {own}", (rank, own) == (15, 15)


def _network(_: Result) -> tuple[str, bool]:
    space = space_of("joint")
    ends = zip(space.low.tolist(), space.high.tolist(), CELLS["joint"], strict=True)
    made = Network([(low, high, n, MEMBERSHIPS) for low, high, n in ends], 15, NETWORK)
    numbers = (made.sensor_cells, made.cell_count, made.active_count)
    words = f"{numbers[0]} = 17 + 11 + 11, {numbers[1]} = 17 x 11 x 11, {numbers[2]} active"
    return words, numbers == (39, 2057, 27)


def _stops(result: Result) -> tuple[str, bool]:
    counts = {name: _of(part, "stops_at", "regions") for name, part in result["readings"].items()}
    low, high = (f([f([c["p05"], c["p95"]]) for c in counts.values()]) for f in (min, max))
    return f"0.1 mm is met at {low:.0f} to {high:.0f} regions; 110 are forced", low <= 110 <= high


def _count(result: Result) -> tuple[str, bool]:
    leaves = _median(result, "figure6", "facts", "measurements")
    total = _median(result, "figure6", "facts", "measured_in_all")
    return f"{leaves:.0f} in the leaves, {total:.0f} with parents and test points", abs(leaves - 2200) < 1


def _uncalibrated(result: Result) -> tuple[str, bool]:
    low = _median(result, "figure6", "uncalibrated", "path", "least_mm")
    high = _median(result, "figure6", "uncalibrated", "path", "max_mm")
    other = result["readings"]["random_cartesian"]["clean"]["uncalibrated"]["path"]
    random = f"{other['least_mm']['median']:.2f} to {other['max_mm']['median']:.2f} mm with random signs"
    return f"{low:.2f} to {high:.2f} mm, all errors positive; {random}", low >= 0.4 and high <= 1.2


def _below(figure: str, schemes: Sequence[str], limit_mm: float) -> Callable[[Result], tuple[str, bool]]:
    def check(result: Result) -> tuple[str, bool]:
        largest = {name: _of(result, figure, name, "path", "max_mm") for name in schemes}
        words = ", ".join(f"{name} {value['median']:.3f} mm" for name, value in largest.items())
        return words, all(value["p95"] < limit_mm for value in largest.values())

    return check


def _boundaries(result: Result) -> tuple[str, bool]:
    regional, fcmac = (_median(result, "figure6", name, "path", "jump_mm") for name in ("regional", "fcmac"))
    return f"error jumps by {regional:.4f} mm, with the FCMAC {fcmac:.4f} mm", fcmac < regional / 2.0


def _similar_spaces(result: Result) -> tuple[str, bool]:
    ratio = {
        figure: _median(result, figure, "fcmac", "workspace", "mean_mm")
        / _median(result, figure, "conventional", "workspace", "mean_mm")
        for figure in ("figure6", "figure7")
        if figure in result
    }
    words = ", ".join(f"{name}: FCMAC / conventional {value:.2f}" for name, value in ratio.items())
    return words, all(value < 0.5 for value in ratio.values())


def _sphere_stops(result: Result) -> tuple[str, bool]:
    regions = _of(result, "figure7", "facts", "stops_at_regions")
    words = f"0.1 mm is met at {regions['p05']:.0f} to {regions['p95']:.0f} regions; 130 are forced"
    return words, regions["p05"] <= 130 <= regions["p95"]


def _missing(result: Result) -> tuple[str, bool]:
    means = {
        name: _median(result, "figure8", name, "path", "inside", "mean_mm")
        for name in ("conventional", "regional", "fcmac")
    }
    words = ", ".join(f"{name} {value:.3f} mm" for name, value in means.items())
    return f"inside it {words}", max(means["regional"], means["fcmac"]) < means["conventional"]


def _homogeneous(result: Result) -> tuple[str, bool]:
    worst = {
        name: _median(result, "paths", name, "path", "worst_mean_mm")
        for name in ("conventional", "regional", "fcmac")
    }
    words = ", ".join(f"{name} {value:.3f} mm" for name, value in worst.items())
    return f"mean of the worst path: {words}", max(worst["regional"], worst["fcmac"]) < worst["conventional"]


def _similar_with_noise(where: str) -> Callable[[Result], tuple[str, bool]]:
    """Whether the FCMAC's largest error on the path or workspace stays below the conventional one."""

    def check(result: Result) -> tuple[str, bool]:
        runs = ("figure6", "noise")
        mean, largest = ([_median(result, run, "fcmac", where, key) for run in runs] for key in SIZES)
        bounds = [_median(result, run, "conventional", where, SIZES[1]) for run in runs]
        words = (
            f"FCMAC: mean {mean[0]:.3f} without noise, {mean[1]:.3f} mm with it, largest {largest[0]:.3f} "
            f"and {largest[1]:.3f} mm; conventional: largest {bounds[0]:.3f} and {bounds[1]:.3f} mm"
        )
        return words, all(error < bound for error, bound in zip(largest, bounds, strict=True))

    return check


def _guaranteed(result: Result) -> tuple[str, bool]:
    parts = result["readings"].values()
    ratio = max(
        part["noise"]["fcmac"]["workspace"]["max_mm"]["median"]
        / part["noise"]["conventional"]["workspace"]["max_mm"]["median"]
        for part in parts
    )
    return (
        f"with noise the FCMAC's largest error is up to {ratio:.1f} times the conventional one",
        ratio <= 1.0,
    )


def _cmac(result: Result) -> tuple[str, bool]:
    cmac, fcmac = (_median(result, "cmac", name, "path", "cep_jump") for name in ("cmac", "fcmac"))
    return f"a CEP changes by {cmac:.4f} mm a mm of path, the FCMAC's by {fcmac:.4f}", cmac > 2.0 * fcmac


def _converges(result: Result) -> tuple[str, bool]:
    share = float(np.mean(_median(result, "figure6", "facts", "fcmac_converged")))
    left = _median(result, "figure6", "facts", "fcmac_largest_left_mm")
    words = f"stalls with {left:.2f} mm (angles at 300 mm) left: cells are shared by unlike regions"
    return ("converges", True) if share >= 1.0 else (words, False)


STATEMENTS: Final = (
    Statement("6", "15 of 25 parameters are observable, by name", "", _observable),
    Statement("6", "39 sensor cells, 2057 association cells, 27 a point", "", _network),
    Statement("6", "joint space: 110 regions for 0.1 mm", "readings", _stops),
    Statement("6", "2200 measurements = 20 x 110", "figure6", _count),
    Statement("Fig. 6(a)", "0.4 to 1.2 mm without calibration", "figure6", _uncalibrated),
    Statement("Fig. 6(b)", "conventional: below 0.2 mm", "figure6", _below("figure6", ["conventional"], 0.2)),
    Statement(
        "Fig. 6(c, d)",
        "regional and FCMAC: below 0.1 mm",
        "figure6",
        _below("figure6", ["regional", "fcmac"], 0.1),
    ),
    Statement("Fig. 6(c, d)", "errors vary at boundaries, not so with the FCMAC", "figure6", _boundaries),
    Statement("5", "training ends within the tolerance", "figure6", _converges),
    Statement("6", "spherical space: 130 regions for 0.1 mm", "figure7", _sphere_stops),
    Statement("Fig. 7", "results like those of joint space", "figure7", _similar_spaces),
    Statement("Fig. 8", "a region without data is met satisfactorily", "figure8", _missing),
    Statement("6", "consistently good on several paths", "paths", _homogeneous),
    Statement(
        "6", "with 3 % of noise results are similar: path", "figure6 noise", _similar_with_noise("path")
    ),
    Statement(
        "6",
        "with 3 % of noise results are similar: workspace",
        "figure6 noise",
        _similar_with_noise("workspace"),
    ),
    Statement("4.2", "guaranteed to be better than the conventional scheme", "readings", _guaranteed),
    Statement("6", "the CMAC's CEPs vary more abruptly", "cmac", _cmac),
)
