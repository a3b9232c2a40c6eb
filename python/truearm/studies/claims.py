"""What the study is to show: ratios over seeds, and the limits they are held against."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from truearm.studies.metrics import quantiles

Result = Mapping[str, Any]


@dataclass(frozen=True)
class Claim:
    """A number of each seed, and what its median has to be.

    Attributes:
        words: What is claimed.
        figure: Which results it needs.
        value: The number, from the results of a seed.
        limit: The median must not be above it (below it, with `at_least`); None where it is told as it comes.
        at_least: Whether the limit is a lower one.
        p95_limit: What the 95 % quantile must not be above.
    """

    words: str
    figure: str
    value: Callable[[Result], float]
    limit: float | None
    at_least: bool = False
    p95_limit: float | None = None

    def judge(self, seeds: Sequence[Result]) -> dict[str, Any] | None:
        """Words, value over the seeds, limit and whether it is reached; None where the figure was not run."""
        if any(self.figure not in seed for seed in seeds):
            return None
        found = quantiles([self.value(seed) for seed in seeds])
        return {"claim": self.words, "value": found, "limit": self.rule, "reached": self._holds(found)}

    @property
    def rule(self) -> str:
        """The limit in words."""
        if self.limit is None:
            return "as it comes"
        bound = f"at {'least' if self.at_least else 'most'} {self.limit:g}"
        return bound if self.p95_limit is None else f"{bound}; 95 % below {self.p95_limit:g}"

    def _holds(self, found: Mapping[str, float]) -> bool | None:
        if self.limit is None:
            return None
        median = found["median"] >= self.limit if self.at_least else found["median"] <= self.limit
        return median and (self.p95_limit is None or found["p95"] < self.p95_limit)


def _ratio(figure: str, scheme: str, other: str, *where: str) -> Callable[[Result], float]:
    def ratio(result: Result) -> float:
        return look_up(result, figure, scheme, *where) / look_up(result, figure, other, *where)

    return ratio


def _path(scheme: str, key: str) -> Callable[[Result], float]:
    return lambda result: look_up(result, "figure6", scheme, "path", key)


def look_up(result: Result, *keys: str) -> float:
    """A number by its keys."""
    found: Any = result
    for key in keys:
        found = found[key]
    return float(found)


MEAN: Final = ("workspace", "mean_mm")
CLAIMS: Final = (
    Claim(
        "no noise: workspace mean error, regional / conventional",
        "figure6",
        _ratio("figure6", "regional", "conventional", *MEAN),
        0.15,
    ),
    Claim(
        "no noise: largest change of a CEP for each mm of path, FCMAC / regional",
        "figure6",
        _ratio("figure6", "fcmac", "regional", "path", "cep_jump"),
        0.2,
    ),
    Claim(
        "no noise: workspace mean error, B-splines on measurements / conventional",
        "figure6",
        _ratio("figure6", "bspline_measurements", "conventional", *MEAN),
        0.01,
    ),
    Claim(
        "noise: workspace mean error, FCMAC on least-squares regional CEPs / conventional",
        "noise",
        _ratio("noise", "fcmac", "conventional", *MEAN),
        None,
    ),
    Claim(
        "noise: workspace mean error, FCMAC on shrunk regional CEPs / conventional",
        "noise",
        _ratio("noise", "fcmac_shrunk", "conventional", *MEAN),
        0.7,
    ),
    Claim(
        "noise: workspace mean error, variable model / conventional",
        "noise",
        _ratio("noise", "variable", "conventional", *MEAN),
        0.25,
    ),
    Claim("Figure 6: least error uncalibrated, mm", "figure6", _path("uncalibrated", "least_mm"), 0.4, True),
    Claim("Figure 6: largest error uncalibrated, mm", "figure6", _path("uncalibrated", "max_mm"), 1.2),
    Claim("Figure 6: largest error, conventional, mm", "figure6", _path("conventional", "max_mm"), 0.2),
    Claim("Figure 6: largest error, regional, mm", "figure6", _path("regional", "max_mm"), 0.1),
    Claim("Figure 6: largest error, FCMAC, mm", "figure6", _path("fcmac", "max_mm"), 0.1),
    Claim(
        "region without data: mean error on the path inside it, variable model / conventional",
        "figure8",
        _ratio("figure8", "variable", "conventional", "path", "inside", "mean_mm"),
        0.7,
        p95_limit=1.0,
    ),
    Claim(
        "largest change of a CEP for each mm of path, CMAC / FCMAC",
        "cmac",
        _ratio("cmac", "cmac", "fcmac", "path", "cep_jump"),
        2.0,
        at_least=True,
    ),
)


def judged(seeds: Sequence[Result]) -> list[dict[str, Any]]:
    """All claims whose figures were run."""
    found = [claim.judge(seeds) for claim in CLAIMS]
    return [entry for entry in found if entry is not None]
