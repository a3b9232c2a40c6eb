"""Lines of the protocol: JSON objects, one a line, in UTF-8. See docs/reference/serve-protocol.md."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import TruearmError
from truearm.streaming import Streamed
from truearm.units import MM_PER_METRE

PROTOCOL: Final = 1
KEYS: Final = ("q", "q_deg", "switch", "features", "id")
LONGEST_ID: Final = 100
LARGEST: Final = 1e9
"""Readings beyond it are a mistake of whoever sends them."""


class MalformedError(TruearmError):
    """A line that is no request; whoever sent it loses the connection."""


@dataclass(frozen=True)
class Request:
    """A set-point, or an order.

    Attributes:
        q: Readings in rad and m; None for a set-point that did not come in time, or for an order.
        is_set_point: Whether an answer with readings is wanted.
        in_degrees: Whether readings were and are to be given in deg and mm.
        switch: Whether to ramp the correction up or down; None for neither.
        features: Values that features have from now on.
        identity: What the answer repeats.
    """

    q: NDArray[np.float64] | None
    is_set_point: bool
    in_degrees: bool
    switch: bool | None
    features: dict[str, float]
    identity: str | int | float | None


class Units:
    """Readings as they are sent, and SI ones."""

    def __init__(self, joints: Sequence[str]) -> None:
        """Of joints of these kinds."""
        self.count = len(joints)
        self._shown = np.array([MM_PER_METRE if k == "prismatic" else math.degrees(1.0) for k in joints])

    def si(self, values: NDArray[np.float64], *, in_degrees: bool) -> NDArray[np.float64]:
        """Readings in rad and m."""
        return values / self._shown if in_degrees else values

    def sent(self, values: NDArray[np.float64], *, in_degrees: bool) -> list[float]:
        """Readings as they are sent."""
        return [float(value) for value in (values * self._shown if in_degrees else values)]


def read_object(line: bytes) -> dict[str, Any]:
    """The JSON object of a line.

    Raises:
        MalformedError: If it is none.
    """
    try:
        content = json.loads(line.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise MalformedError(f"this is no JSON: {error}") from None
    if not isinstance(content, dict):
        raise MalformedError("a request is a JSON object")
    return content


def read_request(line: bytes, units: Units) -> Request:
    """The request of a line.

    Raises:
        MalformedError: If it is none.
    """
    content = read_object(line)
    unknown = sorted(set(content) - set(KEYS))
    if unknown:
        raise MalformedError(f'"{unknown[0][:LONGEST_ID]}" is not known; there are {", ".join(KEYS)}')
    if "q" in content and "q_deg" in content:
        raise MalformedError("a request has q or q_deg, not both")
    in_degrees = "q_deg" in content
    is_set_point = in_degrees or "q" in content
    if not is_set_point and not {"switch", "features"} & set(content):
        raise MalformedError("a request has q, q_deg, switch or features")
    values = _readings(content.get("q_deg" if in_degrees else "q"), units.count)
    q = None if values is None else units.si(values, in_degrees=in_degrees)
    orders = _switch(content), _features(content.get("features", {}))
    return Request(q, is_set_point, in_degrees, *orders, _identity(content.get("id")))


def answer(request: Request, streamed: Streamed, units: Units) -> bytes:
    """The line that answers a request."""
    content: dict[str, Any] = {} if request.identity is None else {"id": request.identity}
    if request.is_set_point:
        q = None if streamed.q is None else units.sent(streamed.q, in_degrees=request.in_degrees)
        content["q_deg" if request.in_degrees else "q"] = q
    content |= {"phase": streamed.phase, "gain": streamed.gain, "lag": streamed.lag, "fault": streamed.fault}
    return line_of(content)


def line_of(content: dict[str, Any]) -> bytes:
    """A line of the protocol."""
    return json.dumps(content, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def _readings(value: Any, count: int) -> NDArray[np.float64] | None:  # noqa: ANN401
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != count:
        raise MalformedError(f"readings are a list of {count} numbers, or null")
    return np.array([_number(entry, "a reading") for entry in value])


def _features(value: Any) -> dict[str, float]:  # noqa: ANN401
    if not isinstance(value, dict):
        raise MalformedError("features are an object of names and numbers")
    return {name: _number(entry, "a feature") for name, entry in value.items()}


def _number(entry: Any, what: str) -> float:  # noqa: ANN401
    """A number; null stands for one that is not there."""
    if entry is None:
        return math.nan
    if isinstance(entry, bool) or not isinstance(entry, int | float):
        raise MalformedError(f"{what} is no number")
    if abs(entry) > LARGEST and entry not in (math.inf, -math.inf):
        raise MalformedError(f"{what} is too large")
    return float(entry)


def _switch(content: dict[str, Any]) -> bool | None:
    if "switch" not in content:
        return None
    if content["switch"] not in ("on", "off"):
        raise MalformedError('switch is "on" or "off"')
    return bool(content["switch"] == "on")


def _identity(value: Any) -> str | int | float | None:  # noqa: ANN401
    if value is None:
        return None
    known = isinstance(value, str | int) or (isinstance(value, float) and math.isfinite(value))
    if known and not isinstance(value, bool) and len(str(value)) <= LONGEST_ID:
        return value  # type: ignore[no-any-return]
    raise MalformedError(f"id is a number or a text of at most {LONGEST_ID} characters")
