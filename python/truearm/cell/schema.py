"""Checking a section of the cell file against its pydantic class, with errors that name key and rule."""

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from truearm.errors import InputError, did_you_mean
from truearm.strictly import strictly

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Frame = Annotated[str, Field(pattern="^[78][NEO][12]$")]
TcpPort = Annotated[int, Field(ge=1, le=65535)]
Vector2 = tuple[Number, Number]
Vector3 = tuple[Number, Number, Number]
Quaternion = tuple[Number, Number, Number, Number]
UNIT_RULES: Final = {
    "missing": "It must be given",
    "finite_number": "Must be a finite number",
    "float_type": "Must be a number",
    "float_parsing": "Must be a number",
    "int_type": "Must be a whole number",
    "int_from_float": "Must be a whole number",
    "int_parsing": "Must be a whole number",
    "string_type": "Must be text in quotes",
    "bool_type": "Must be true or false",
    "bool_parsing": "Must be true or false",
    "model_type": "Must be a section of its own",
    "tuple_type": "Must be a list in square brackets",
    "list_type": "Must be a list in square brackets",
    "string_too_short": "Must not be empty",
    "too_short": "Must not be empty",
}
M = TypeVar("M", bound=BaseModel)


class Section(BaseModel):
    """A section of the cell file: no other keys than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def checked(model: type[M], content: Mapping[str, Any], *, where: str) -> M:
    """A section as an object.

    Raises:
        InputError: If a key is unknown or missing, or a value breaks its rule.
    """
    try:
        return strictly(model, content)
    except ValidationError as error:
        details = error.errors(include_url=False)
        unknown = [detail for detail in details if detail["type"] == "extra_forbidden"]
        raise _in_words(model, (unknown or details)[0], details).at(where) from None


def _in_words(model: type[BaseModel], detail: ErrorDetails, details: Sequence[ErrorDetails]) -> InputError:
    place = [str(part + 1) if isinstance(part, int) else part for part in detail["loc"]]
    key = ", ".join(place)
    if detail["type"] == "extra_forbidden":
        known = _known_keys(model, place[:-1])
        hint = did_you_mean(place[-1], known) or f"Known here: {', '.join(known)}"
        return InputError(f'unknown key "{key}"', rule=hint)
    if detail["type"] == "missing" and not isinstance(detail["loc"][-1], int):
        return InputError(f'key "{key}" is missing')
    if detail["type"] == "literal_error":
        known = re.findall("'([^']*)'", detail["ctx"]["expected"])
        rule, way_out = f"Either {' or '.join(known)}", did_you_mean(str(detail["input"]), known)
        return InputError(f'"{detail["input"]}" is not known', where=key, rule=rule, way_out=way_out)
    if detail["type"] == "value_error":
        return InputError(str(detail["ctx"]["error"]), where=key)
    shown = repr(detail["input"])
    value = f"{shown} cannot be used" if len(shown) < 60 else "the value cannot be used"
    if detail["type"] in ("missing", "too_long"):
        *place, _ = place if detail["type"] == "missing" else (*place, "")
        rule = f"It must have {_length(detail, details)} values"
        return InputError(value, where=", ".join(place), rule=rule)
    return InputError(value, where=key, rule=UNIT_RULES.get(detail["type"], detail["msg"]))


def _length(detail: ErrorDetails, details: Sequence[ErrorDetails]) -> int:
    """How many values a list that has too few or too many must have."""
    if detail["type"] == "too_long":
        return int(detail["ctx"]["max_length"])
    missing = [other for other in details if other["loc"][:-1] == detail["loc"][:-1]]
    return len(detail["input"]) + len(missing)


def _known_keys(model: type[BaseModel], place: list[str]) -> list[str]:
    for name in place:
        field = model.model_fields.get(name)
        inner = field.annotation if field is not None else None
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            break
        model = inner
    return list(model.model_fields)
