"""What an update found out about joints, and what it could not test, in sentences."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

OPTIONS: Final = {
    "frame": ("--keep-frame", "the device stands where it stood"),
    "base": ("--keep-frame", "device and base stand where they stood"),
    "tool": ("--keep-tool", "the target sits where it sat"),
}
"""Of what a joint may be confounded with: the option that keeps it, and when that is right."""


MEANWHILE: Final = (
    "Something was otherwise from some row on, as the warning says: put that right and update the "
    "calibration before once more, which may still hold."
)
"""What to do with an update from rows that something slipped between."""
CHANGED_MEANWHILE: Final = {
    "holds": f"No significant change was found. {MEANWHILE}",
    "moved": f"{{tested}} changed, as far as these rows tell. {MEANWHILE}",
    "scale": f"All lengths are others, as far as these rows tell. {MEANWHILE}",
    "load": f"The joints give way otherwise, as far as these rows tell. {MEANWHILE}",
    "field": f"{{estimated}} do not explain what was measured. {MEANWHILE}",
}
"""What an update from such rows found, by its verdict; `tested` and `estimated` are listed."""
FIVE_OF_SIX: Final = (
    "As a row of the table the base has five of the six freedoms of a frame: constants do not correct a "
    "shift along the sixth, the y axis of most bases."
)


def kept_words(before_mm: float, after_mm: float) -> str:
    """That a calibration which holds is the more certain one as it was, in sentences."""
    return (
        "Nothing moved, and the calibration as it was is the more certain: over its own poses, with frame "
        f"and target found anew, its expected standard deviation is {before_mm:.3f} mm, and {after_mm:.3f} "
        "mm after the update. Keep it; what these poses tell is worth more in a calibration from old and new "
        "rows together."
    )


def cause_words(told: Mapping[str, Any]) -> str:
    """Which other scale or load was found, in a sentence; "" for none.

    Args:
        told: What `Update.to_dict` gives.
    """
    cause = told.get("cause")
    if cause is None:
        return ""
    then = "than when the arm was calibrated"
    if cause["name"] == "scale":
        way = "larger" if cause["ppm"] > 0.0 else "smaller"
        whose = "" if cause["taken"] else ", or the measuring device's scale differs"
        return f"All lengths are {abs(cause['ppm']):.0f} ppm {way} {then}{whose}."
    way, weight = ("more", "a heavier") if sum(cause["bent_mrad"]) > 0.0 else ("less", "a lighter")
    return f"The joints give way {way} {then}, as under {weight} weight."


def found_otherwise(told: Mapping[str, Any], tested: str) -> str:
    """The verdict where another scale or load was found, in sentences; "" for none.

    Args:
        told: What `Update.to_dict` gives.
        tested: What was tested for a change, as a sentence begins.
    """
    found = cause_words(told)
    if not found:
        return ""
    fits = "All else still fits"
    if told["changed"]["p"] < told["threshold"]:
        fits = f"{tested} changed as well; all else still fits"
    stored = "with it" if told["cause"]["taken"] else "without it: it is right for an arm as it was then"
    return f"{found} {fits}. The updated calibration is {stored}."


def of_known_world(told: Mapping[str, Any]) -> str:
    """What may look like a field that changed where the world is known, in sentences; "" where it is not.

    Args:
        told: What `Update.to_dict` gives.
    """
    is_known = any(motion.get("part") == "base" for motion in told["frames"])
    return f"{FIVE_OF_SIX} If the device was shifted so, nothing else fits." if is_known else ""


def follows_words(joint: int, followed: int) -> str:
    """That one motor explains the changes of two coupled joints, counted from 1, in a sentence."""
    return (
        f"Joint {joint} is coupled to joint {followed}, and its change is what that of joint {followed} "
        f"makes of its reading: one motor was re-mastered or slipped, that of joint {followed}."
    )


def untested_joints(told: Mapping[str, Any]) -> str:
    """That some joints were not tested, in a sentence; "" where all were.

    Args:
        told: What `Update.to_dict` gives.
    """
    joints = [entry["joint"] for entry in told["offsets"] if not entry["told"]]
    return f"{_named(joints)} {_were(joints)} not tested." if joints else ""


def untested_words(told: Mapping[str, Any], groups: Sequence[str]) -> str:
    """The same with reasons, and with the options that would tell more; "" where all were tested.

    Args:
        told: What `Update.to_dict` gives.
        groups: Names of the update's set-ups; an option is of use where the calibration knew them all.
    """
    by_reason: dict[str, list[int]] = {}
    for entry in told["offsets"]:
        if not entry["told"]:
            by_reason.setdefault(entry["confounded"], []).append(entry["joint"])
    return " ".join(_reason(told, groups, reason, joints) for reason, joints in by_reason.items())


def motion_name(part: str, group: str) -> str:
    """What moved: "base", or "tool of east"."""
    return part if part == "base" else f"{part} of {group}"


def way_out_of_keeping(kept: tuple[str, ...]) -> str:
    """What to do where what was kept may have moved: "frame", "base", "tool"."""
    if not kept:
        return ""
    chosen = [OPTIONS[name] for name in kept]
    return "Leave " + ", and ".join(f"{option} out unless {right}" for option, right in chosen)


def _reason(told: Mapping[str, Any], groups: Sequence[str], reason: str, joints: list[int]) -> str:
    if not reason:
        return f"{_named(joints)} {_were(joints)} not tested: these poses do not determine {_it(joints)}."
    words = f"{_named(joints)} {_were(joints)} not tested, since confounded with the {reason}"
    parts = reason.split(" and ")
    if not all(_may_be_kept(told, groups, part) for part in parts):
        return f"{words}."
    options, conditions = zip(*(OPTIONS[part] for part in parts), strict=True)
    verb = "tells" if len(options) == 1 else "tell"
    return f"{words}: if {' and '.join(conditions)}, {' '.join(options)} {verb} {_it(joints)}."


def _may_be_kept(told: Mapping[str, Any], groups: Sequence[str], part: str) -> bool:
    """Whether all frames are known and could be kept, or all tools, which are not said to be others."""
    motions = told["tools" if part == "tool" else "frames"]
    known = {motion["group"] for motion in motions if part != "tool" or motion["p"] is not None}
    return known.issuperset(groups)


def _named(joints: list[int]) -> str:
    numbers = [str(joint) for joint in joints]
    if len(numbers) == 1:
        return f"Joint {numbers[0]}"
    return f"Joints {', '.join(numbers[:-1])} and {numbers[-1]}"


def _were(joints: list[int]) -> str:
    return "was" if len(joints) == 1 else "were"


def _it(joints: list[int]) -> str:
    return "it" if len(joints) == 1 else "them"
