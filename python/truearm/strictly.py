"""What a file holds as an object of its pydantic class: text is no number, and a number no yes or no."""

import json
import os
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel

M = TypeVar("M", bound=BaseModel)


def strictly(model: type[M], content: Mapping[str, Any]) -> M:
    """The values of a TOML file, taken as those of a JSON text: each is of its field's type, a list a tuple.

    Raises:
        ValidationError: If a key is unknown or missing, or a value breaks its rule.
    """
    return model.model_validate_json(json.dumps(content, default=_plain), strict=True)


def _plain(value: object) -> object:
    """A path as text; a date or time of TOML as what is of no field's type."""
    return os.fspath(value) if isinstance(value, os.PathLike) else {type(value).__name__: str(value)}
