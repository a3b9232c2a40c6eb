"""A calibration as arrays and JSON values, and back, bit for bit."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm import revision
from truearm._core import Field, Setup
from truearm.certainty import conservative
from truearm.certainty.learnt_features import learnt_spans
from truearm.certainty.standard_errors import of_covariance
from truearm.defaults import NO_DRIFT
from truearm.errors import InputError, Notice, UsageError
from truearm.fits import schemes
from truearm.fits.core_set import Selection
from truearm.fits.details import ConstantDetails, VariableDetails
from truearm.fits.fitted_rows import FittedRows
from truearm.fits.identifiability import Identifiability
from truearm.fits.identified import IdentifiedArm
from truearm.fits.known_scale import KnownScale, common_share
from truearm.fits.measured_parts import MeasuredParts
from truearm.fits.models import NOMINAL, ArmModel
from truearm.fits.options import CalibrationOptions
from truearm.fits.scheme_fitting import SchemeDetails
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.validation import Validation
from truearm.robot import Robot
from truearm.storage import rows_content
from truearm.storage.calibration_arrays import as_stored, check_arrays
from truearm.storage.calibration_checks import check_plain, check_set_ups, check_set_ups_of_rows
from truearm.storage.calibration_file import AGAIN

if TYPE_CHECKING:
    from truearm.calibration import Calibration

Arrays = dict[str, NDArray[Any]]

SETUP_PARTS: Final = ("frames", "targets", "rotations", "anchors")
CONSTANT_KEYS: Final = ("noise_m", "noise_rad", "prior_scale", "iterations", "reason")
LEFT_OUT: Final[Mapping[str, str]] = {"drift": NO_DRIFT}
"""Options that calibrations of earlier versions do not name, as they were made."""
VARIABLE_KEYS: Final = ("evidence", "evaluations", "inflation", "unexplained_m")


def pack(calibration: "Calibration", *, with_rows: bool) -> tuple[Arrays, dict[str, Any]]:
    """Arrays and JSON values of a calibration."""
    arrays: Arrays = {
        "constant.covariance": calibration.constant.covariance,
        "constant.standard_errors": calibration.constant.standard_errors,
    }
    content: dict[str, Any] = {
        "version": calibration.version,
        "robot": calibration.robot.to_dict(),
        "controller_model": None,
        "options": calibration.options.to_dict(),
        "groups": list(calibration.groups),
        "selection": {**asdict(calibration.selection), "targets": list(calibration.selection.targets)},
        "measured": calibration.measured.pack(),
        "identifiability": calibration.identifiability.to_dict(),
        "constant": _constant(calibration.constant),
        "variable": _variable(calibration),
        "scheme": None if calibration.scheme is None else calibration.scheme.to_dict(),
        "models": {name: _model(name, model, arrays) for name, model in calibration.models.items()},
        "validation": calibration.validation.to_dict(),
        "data_sha256": calibration.data_hash,
        "notices": [{**asdict(notice), "rows": list(notice.rows)} for notice in calibration.notices],
        "rows": None,
        "held": None,
        "conservative": None,
        "update": None,
    }
    if calibration.has_conservative:
        content["conservative"] = conservative.pack(calibration.conservative, arrays)
    if with_rows and calibration.rows is not None:
        content["rows"] = rows_content.pack(calibration.rows, calibration.options.features, arrays)
    if calibration.revision is not None:
        content["update"] = revision.pack(calibration.revision, arrays, whole=with_rows)
    if with_rows and calibration.held is not None:
        content["held"] = calibration.held.pack(arrays)
    return as_stored(arrays), content


def unpack(arrays: Arrays, content: Mapping[str, Any], *, where: str) -> dict[str, Any]:
    """Arguments of Calibration.

    Raises:
        InputError: If a key or an array is missing, or holds what no calibration does.
    """
    try:
        check_plain(content)
        return _fields(arrays, content)
    except KeyError as error:
        raise InputError(f"the calibration has no {error}", where=where) from None
    except InputError as error:
        raise error.at(where) from error
    except Exception as error:
        raise InputError(
            f"what this calibration holds cannot be read: {error}",
            where=where,
            rule="It is whole, but not as truearm writes one",
            way_out=AGAIN,
        ) from error


def _fields(arrays: Arrays, content: Mapping[str, Any]) -> dict[str, Any]:
    options = _read_options(content["options"])
    robot = Robot.from_dict(content["robot"])
    arm = IdentifiedArm(robot, options.frame)
    selection = Selection(**{**content["selection"], "targets": tuple(content["selection"]["targets"])})
    constant, held = content["constant"], content.get("held")
    bounds = content.get("conservative")
    check_arrays(arrays, content, arm.table.shape, robot.joint_count)
    judged = None if held is None else HeldRows.unpack(held, arrays)
    inputs = robot.joint_count + len(options.features)
    models = {
        name: _read_model(name, stored, arrays, (inputs, arm)) for name, stored in content["models"].items()
    }
    for model in models.values():
        check_set_ups(len(content["groups"]), len(model.setup.frames))
    rows = _read_rows(content, arrays, selection)
    if rows is not None:
        check_set_ups_of_rows(rows.data.groups, content["groups"])
    measured = _read_measured(content, selection, rows)
    identifiability = Identifiability.from_dict(content["identifiability"])
    details = _read_constant(constant, arrays)
    if details.scale is None and not content.get("update"):
        scale = _scale_of(rows, measured, identifiability.total_rank, details.noise_m)
        details = replace(details, scale=scale)
    return {
        "robot": robot,
        "options": options,
        "groups": tuple(content["groups"]),
        "selection": selection,
        "measured": measured,
        "models": models,
        "identifiability": identifiability,
        "constant": details,
        "variable": _read_variable(content["variable"]),
        "scheme": SchemeDetails(**content["scheme"]) if content.get("scheme") else None,
        "validation": _read_validation(content["validation"], selection, judged),
        "rows": rows,
        "held": judged,
        "data_hash": content["data_sha256"],
        "version": content["version"],
        "notices": tuple(_notice(stored) for stored in content.get("notices", ())),
        "stored_conservative": None
        if bounds is None
        else conservative.unpack(bounds, arrays, robot.flange_chain),
        "revision": revision.unpack(content["update"], arrays) if content.get("update") else None,
    }


def _read_validation(content: Mapping[str, Any], selection: Selection, held: HeldRows | None) -> Validation:
    """The validation; files of earlier versions count their distances by their rows alone."""
    found = Validation.from_dict(content)
    if not selection.distances or held is None or found.n_holdout_distances is not None:
        return found
    return replace(found, n_holdout_distances=int(held.errors[NOMINAL].measured.sum()))


def _read_rows(content: Mapping[str, Any], arrays: Arrays, selection: Selection) -> FittedRows | None:
    rows = content["rows"]
    return None if rows is None else rows_content.unpack(rows, arrays, selection=selection)


def _read_measured(
    content: Mapping[str, Any], selection: Selection, rows: FittedRows | None
) -> MeasuredParts:
    """What each set-up measured; of files of earlier versions, which do not say, from their rows."""
    groups = content["groups"]
    if content.get("measured"):
        return MeasuredParts.unpack(content["measured"], selection, len(groups))
    if rows is None:
        return MeasuredParts.whole(selection, len(groups))
    return MeasuredParts.of(rows.data, selection, groups)


def _read_options(content: Mapping[str, Any]) -> CalibrationOptions:
    """The options of a file; numbers of another kind than is asked for today are taken where they are equal.

    Raises:
        InputError: If there is no such option, or a value breaks a rule.
    """
    usual = CalibrationOptions().to_dict()
    given = {name: _as_asked_for(value, usual.get(name)) for name, value in content.items()}
    try:
        return CalibrationOptions.of(**{**LEFT_OUT, **given})
    except UsageError as error:
        raise InputError(error.what, where=error.where, rule=error.rule, way_out=AGAIN) from error


def _as_asked_for(value: Any, usual: Any) -> Any:  # noqa: ANN401
    """A value of JSON as the kind that an option's usual one is of: 0 and 1 as flags, 2.0 as 2, true as 1."""
    if isinstance(usual, bool):
        return bool(value) if value in (0, 1) else value
    if isinstance(value, list):
        return [_as_asked_for(part, None) for part in value]
    is_whole = isinstance(value, float) and value.is_integer() and not isinstance(usual, float)
    return int(value) if is_whole or isinstance(value, bool) else value


def _notice(content: Mapping[str, Any]) -> Notice:
    return Notice(content["kind"], content["message"], tuple(content["rows"]))


def _constant(details: ConstantDetails) -> dict[str, Any]:
    scale = None if details.scale is None else asdict(details.scale)
    plain = {key: getattr(details, key) for key in CONSTANT_KEYS}
    return {"names": list(details.names), **plain, "scale": scale}


def _scale_of(rows: FittedRows | None, measured: MeasuredParts, rank: int, noise_m: float) -> KnownScale:
    """What files of earlier versions do not say, from their rows, or from how much was measured."""
    if rows is None:
        return KnownScale(max(measured.values - rank, 1), None)
    targets, stated_m = measured.targets.shape[1], rows.data.stated_sigma_m
    common = common_share(rows.residual, rows.weight, targets, noise_m, stated_m)
    return KnownScale.of(rows.residual, rank, rows.data, common)


def _read_constant(content: Mapping[str, Any], arrays: Arrays) -> ConstantDetails:
    """Details of the constants; files of earlier versions hold no standard errors beside the covariance."""
    names, covariance = tuple(content["names"]), arrays["constant.covariance"]
    errors, scale = arrays.get("constant.standard_errors"), content.get("scale")
    return ConstantDetails(
        names=names,
        covariance=covariance,
        standard_errors=of_covariance(covariance, len(names)) if errors is None else errors,
        scale=None if scale is None else KnownScale(**scale),
        **{key: content[key] for key in CONSTANT_KEYS},
    )


def _variable(calibration: "Calibration") -> dict[str, Any] | None:
    details = calibration.variable
    if details is None:
        return None
    return {
        "hyper": {name: details.hyper[name] for name in sorted(details.hyper)},
        "feature_ranges": list(details.feature_ranges),
        "feature_lowest": [low for low, _ in learnt_spans(calibration)],
        **{key: getattr(details, key) for key in VARIABLE_KEYS},
    }


def _read_variable(content: Mapping[str, Any] | None) -> VariableDetails | None:
    if content is None:
        return None
    return VariableDetails(
        hyper=content["hyper"],
        feature_ranges=tuple(content["feature_ranges"]),
        feature_lowest=_read_lowest(content),
        **{key: content[key] for key in VARIABLE_KEYS},
    )


def _read_lowest(content: Mapping[str, Any]) -> tuple[float, ...] | None:
    """The lowest value of each feature; None where the file does not say."""
    lowest, ranges = content.get("feature_lowest"), content["feature_ranges"]
    if not lowest:
        return None
    if len(lowest) != len(ranges):
        raise InputError(
            f"'variable.feature_lowest' has {len(lowest)} values", rule=f"There are {len(ranges)} features"
        )
    return tuple(lowest)


def _model(name: str, model: ArmModel, arrays: Arrays) -> dict[str, Any]:
    """JSON values of a model; its arrays are added to `arrays`."""
    arrays[f"{name}.constants"] = model.constants
    for part in SETUP_PARTS:
        arrays[f"{name}.{part}"] = getattr(model.setup, part)
    if model.scheme is not None:
        return {"blocks": None, "scheme": model.scheme.pack(name, arrays)}
    if model.field is None:
        return {"blocks": None}
    blocks = []
    for number, block in enumerate(model.field.blocks()):
        arrays[f"{name}.block{number}.weights"] = block.pop("weights")
        blocks.append({**block, "axes": [list(axis) for axis in block["axes"]]})
    return {"blocks": blocks}


def _read_model(
    name: str, content: Mapping[str, Any], arrays: Arrays, of: tuple[int, IdentifiedArm]
) -> ArmModel:
    """A model; `of` are the number of inputs and the arm."""
    inputs, arm = of
    setup = Setup(*(arrays[f"{name}.{part}"] for part in SETUP_PARTS))
    field = None
    if content["blocks"] is not None:
        blocks = [
            {
                **block,
                "axes": [tuple(axis) for axis in block["axes"]],
                "weights": arrays[f"{name}.block{number}.weights"],
            }
            for number, block in enumerate(content["blocks"])
        ]
        field = Field(inputs, arm.table.size, blocks, arm.flange_chain)
    kept = content.get("scheme")
    scheme = schemes.unpack(kept, name, arrays) if kept else None
    return ArmModel(np.ascontiguousarray(arrays[f"{name}.constants"]), setup, field, scheme)
