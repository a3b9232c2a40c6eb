"""Where a path steps: between corrected targets and places that are left as they are."""

import numpy as np

from truearm.errors import Notice, count_of
from truearm.programs.listing import listed_target
from truearm.programs.program import Program, Unplaced, motion_is_straight
from truearm.programs.uses import Uses
from truearm.types import Mask


def step_notices(program: Program, uses: Uses, changed: Mask) -> tuple[Notice, ...]:
    """A warning where straight or blended motion leads past what is left between changed targets, (t,)."""
    along = uses.moved & (uses.straight | uses.blended)
    left = np.flatnonzero(along & ~changed)
    unplaced = [one for one in program.unplaced if _steps(program, one, changed)]
    count = len(left) + len(unplaced)
    if count == 0 or not changed.any():
        return ()
    lines = {listed_target(program, int(target), "").line for target in left}
    lines |= {program.sources[one.file].place(one.at)[0] for one in unplaced}
    stay = "stays" if count == 1 else "stay"
    text = (
        f"{count_of(count, 'target')} of linear, circular or blended motion {stay} uncorrected between "
        "corrected ones: the path steps there by the correction, see the listing"
    )
    return (Notice("steps", text, tuple(sorted(lines))),)


def _steps(program: Program, one: Unplaced, changed: Mask) -> bool:
    """Whether the moves beside a motion lead to a changed target, and one of them or it shows the step."""
    moves = program.moves
    here = np.flatnonzero(moves.moving & (moves.source == one.file))
    behind = int(np.searchsorted(moves.at[here], one.at))
    before, after = here[max(behind - 1, 0) : behind].tolist(), here[behind : behind + 1].tolist()
    curved = [motion_is_straight(int(moves.motion[move])) for move in after]
    passed = [bool(moves.blended[move]) for move in (*before, *after)]
    shown = any((motion_is_straight(one.motion), one.blended, *curved, *passed))
    return shown and bool(changed[moves.target[[*before, *after]]].any())
