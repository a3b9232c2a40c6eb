"""Tables of errors, as calibrate, evaluate and demo print them."""

from collections.abc import Mapping

from truearm.cli.console import print_table
from truearm.judgement.validation import HEADINGS, Errors, Statistics


def print_errors(errors: Mapping[str, Errors], judged: str, of: str = "position") -> None:
    """Print the errors of each model: position in mm, and orientation in mrad where it was measured.

    Args:
        errors: Errors by name of the model.
        judged: What was judged, such as "832 held-out poses".
        of: What was measured in mm: "position" or "distance".
    """
    _print({name: found.position for name, found in errors.items()}, f"{of.capitalize()} error, mm, {judged}")
    turned = {name: found.orientation for name, found in errors.items() if found.orientation is not None}
    if turned:
        _print(turned, f"Orientation error, mrad, {judged}")


def _print(statistics: Mapping[str, Statistics], title: str) -> None:
    rows = [
        (name, *(f"{value:.3f}" for value in (s.mean, s.rms, s.p95, s.p99, s.max)))
        for name, s in statistics.items()
    ]
    print_table(["model", *HEADINGS], rows, title=title)
