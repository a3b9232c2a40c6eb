"""What the paper says of its experiment, beside what comes out here."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from truearm.defaults import PAPER_POSES, PAPER_REGIONS
from truearm.studies.claims import Claim, look_up
from truearm.studies.statements import Statement

Result = Mapping[str, Any]


def _path(scheme: str, key: str) -> Callable[[Result], float]:
    return lambda result: look_up(result, "figure10", scheme, "path", key)


def _ratio(scheme: str, key: str) -> Callable[[Result], float]:
    def ratio(result: Result) -> float:
        return _path(scheme, key)(result) / _path("conventional", key)(result)

    return ratio


CLAIMS: Final = (
    Claim("least error uncalibrated, mm", "figure10", _path("uncalibrated", "least_mm"), 0.3, at_least=True),
    Claim("largest error uncalibrated, mm", "figure10", _path("uncalibrated", "max_mm"), 2.5),
    Claim("largest error, conventional, mm", "figure10", _path("conventional", "max_mm"), 1.2),
    Claim("largest error, regional, mm", "figure10", _path("regional", "max_mm"), 0.5),
    Claim("largest error, FCMAC, mm", "figure10", _path("fcmac", "max_mm"), 0.5),
    Claim("largest error, regional / conventional", "figure10", _ratio("regional", "max_mm"), 0.5),
    Claim("largest error, FCMAC / conventional", "figure10", _ratio("fcmac", "max_mm"), 0.5),
    Claim(
        "largest change of a CEP a mm of path, FCMAC / regional",
        "figure10",
        lambda result: _path("fcmac", "cep_jump")(result) / _path("regional", "cep_jump")(result),
        0.5,
    ),
    Claim("ours: largest error, variable model, mm", "figure10", _path("variable", "max_mm"), 0.5),
    Claim("ours: mean error, variable / conventional", "figure10", _ratio("variable", "mean_mm"), 0.5),
)
HOURS: Final = Claim("hours of measuring", "session", lambda result: look_up(result, "session", "hours"), 3.0)
"""Of an experiment as large as the paper's."""
AGREES: Final[Mapping[bool | None, str]] = {True: "yes", False: "no", None: "of another size"}


def _as_large(result: Result) -> bool:
    """Whether the experiment has as many regions, and poses in each, as the paper's."""
    session = result["session"]
    return (session["regions"], session["poses"]) == (PAPER_REGIONS, PAPER_POSES)


def _sizes(result: Result, *schemes: str) -> str:
    path = result["figure10"]
    return ", ".join(f"{name} {path[name]['path']['max_mm']:.2f} mm" for name in schemes)


def _uncalibrated(result: Result) -> tuple[str, bool]:
    found = result["figure10"]["uncalibrated"]["path"]
    low, high = found["least_mm"], found["max_mm"]
    return f"{low:.2f} to {high:.2f} mm", round(low, 1) >= 0.3 and round(high, 1) <= 2.5


def _conventional(result: Result) -> tuple[str, bool]:
    found = result["figure10"]["conventional"]["path"]
    return f"{found['max_mm']:.2f} mm at most, {found['mean_mm']:.2f} mm mean", found["max_mm"] < 1.2


def _below(result: Result) -> tuple[str, bool]:
    found = [result["figure10"][name]["path"]["max_mm"] for name in ("regional", "fcmac")]
    return f"{_sizes(result, 'regional', 'fcmac')} at most", max(found) < 0.5


def _half(result: Result) -> tuple[str, bool]:
    ratios = [_ratio(name, "max_mm")(result) for name in ("regional", "fcmac")]
    return " and ".join(f"{ratio:.2f} of the conventional" for ratio in ratios), max(ratios) <= 0.5


def _smooth(result: Result) -> tuple[str, bool]:
    regional, fcmac = (_path(name, "cep_jump")(result) for name in ("regional", "fcmac"))
    return (
        f"a CEP changes by {regional:.4f} mm a mm of path, {fcmac:.4f} with the FCMAC",
        fcmac < regional / 2,
    )


def _several(result: Result) -> tuple[str, bool]:
    paths = result["paths"]
    worst = {name: paths[name]["worst_mean_mm"] for name in ("conventional", "regional", "fcmac")}
    words = ", ".join(f"{name} {value:.2f} mm" for name, value in worst.items())
    return f"mean of the worst of ten: {words}", max(worst["regional"], worst["fcmac"]) < worst[
        "conventional"
    ]


def _demanded(result: Result) -> tuple[str, bool | None]:
    share = result["figure10"]["regional"]["tests"]["regions_within"]
    needed = result["session"]["regions_that_suffice"]
    words = (
        f"met in {share:.0%} of {result['session']['regions']:.0f} regions, as measured; by itself the "
        f"division stops at {needed:.0f}"
    )
    return words, share >= 1.0 if _as_large(result) else None


def _time(result: Result) -> tuple[str, bool | None]:
    session = result["session"]
    words = (
        f"{session['hours']:.1f} h for {session['measurements']:.0f} poses at five seconds, "
        f"{session['hours_in_all']:.1f} h with the test points"
    )
    return words, session["hours"] < 3.0 if _as_large(result) else None


STATEMENTS: Final = (
    Statement("7", "85 regions, each within 0.5 mm", "figure10", _demanded),
    Statement("7", "a couple of hours at five seconds a measurement", "session", _time),
    Statement("Fig. 10(a)", "0.3 to 2.5 mm without calibration", "figure10", _uncalibrated),
    Statement("Fig. 10(b)", "conventional: below 1.2 mm", "figure10", _conventional),
    Statement("Fig. 10(c, d)", "regional and FCMAC: below 0.5 mm", "figure10", _below),
    Statement("7", "they reduce errors by about half as against the conventional", "figure10", _half),
    Statement("Fig. 10(f, g)", "the FCMAC smooths the CEPs", "figure10", _smooth),
    Statement("7", "consistently good on several paths, unlike the conventional", "paths", _several),
)


def judged(result: Result) -> dict[str, Any]:
    """Claims and statements with what came out."""
    statements = []
    for statement in STATEMENTS:
        ours, agrees = statement.check(result)
        said = {"place": statement.place, "paper": statement.paper}
        statements.append({**said, "ours": ours, "agrees": None if agrees is None else bool(agrees)})
    return {"claims": _claims([result]), "statements": statements}


def judged_over_arms(results: Sequence[Result]) -> dict[str, Any]:
    """Claims over several arms, and with how many of them each statement agrees, None as with one of them."""
    statements = []
    for statement in STATEMENTS:
        each = [statement.check(result)[1] for result in results]
        agrees = None if None in each else sum(bool(one) for one in each)
        statements.append({"place": statement.place, "paper": statement.paper, "agrees": agrees})
    return {"claims": _claims(results), "statements": statements}


def arms_that_agree(statement: Mapping[str, Any]) -> str:
    """On how many arms a statement of `judged_over_arms` holds, in words."""
    return AGREES[None] if statement["agrees"] is None else str(statement["agrees"])


def _claims(results: Sequence[Result]) -> list[dict[str, Any]]:
    asked = (*CLAIMS, HOURS) if _as_large(results[0]) else CLAIMS
    claims = [claim.judge(results) for claim in asked]
    return [claim for claim in claims if claim is not None]
