"""What the plain values of a calibration file have to be; robot and options check theirs themselves."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from truearm.errors import InputError, list_names

Count = Annotated[int, Field(ge=0)]


class _Part(BaseModel):
    """Values of JSON as they are: nothing is turned into a number that is none."""

    model_config = ConfigDict(strict=True)


class _Selection(_Part):
    targets: list[Count]
    orientation: bool
    distances: bool
    judge: Count


class _Measured(_Part):
    rows: list[Count]
    targets: list[list[Count]]
    orientations: list[Count]
    worth: list[list[float]] | None = None


class _Identifiability(_Part):
    parameters: Count
    determined: list[str]
    undetermined: list[str]
    words: list[str]
    total_rank: Count
    condition: float


class _Scale(_Part):
    freedom: Count
    sigma_m: float | None
    common: float = 0.0


class _Constant(_Part):
    names: list[str]
    noise_m: float
    noise_rad: float
    prior_scale: float
    iterations: Count
    reason: str
    scale: _Scale | None = None


class _Variable(_Part):
    hyper: dict[str, list[float]]
    evidence: float
    evaluations: Count
    inflation: float
    unexplained_m: float
    feature_ranges: list[float]
    feature_lowest: list[float] | None = None


class _Notice(_Part):
    kind: str
    message: str
    rows: list[Count]


class _Content(_Part):
    version: str
    groups: list[str]
    data_sha256: str
    selection: _Selection
    identifiability: _Identifiability
    constant: _Constant
    variable: _Variable | None
    notices: list[_Notice] = []
    measured: _Measured | None = None


def check_plain(content: Mapping[str, Any]) -> None:
    """Raise InputError where a plain value is missing, or is none that a calibration has there."""
    try:
        _Content.model_validate(dict(content))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] == "missing":
            raise InputError(f"the calibration has no '{key}'") from None
        raise InputError(f"'{key}' is {first['input']!r:.60}", rule=first["msg"]) from None


def check_set_ups(groups: int, frames: int) -> None:
    """Raise InputError unless as many set-ups are named as there are frames of a model."""
    if groups != frames:
        raise InputError(f"the calibration names {groups} set-ups", rule=f"Its models have {frames}")


def check_set_ups_of_rows(named: Sequence[str], groups: Sequence[str]) -> None:
    """Raise InputError where rows are of a set-up that the calibration does not have."""
    for name in named:
        if name not in groups:
            raise InputError(f'rows are of the set-up "{name}"', rule=f"It has {list_names(groups)}")
