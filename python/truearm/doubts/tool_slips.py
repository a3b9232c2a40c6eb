"""Tools that slip with several targets, of what constants leave of the middle of these."""

from dataclasses import dataclass, replace

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.at_once import TARGET, TARGET_SLIPPED, Shape, Step
from truearm.doubts.slips import Session, Slip, sessions_of, slips_of
from truearm.doubts.whitened import Whitened
from truearm.fits.fitted_rows import FittedRows
from truearm.types import AXES, Floats


def tool_slips(found: Calibration, fitted: FittedRows, progress: Floats) -> list[Slip]:
    """Tools that slipped with all their targets, of a calibration of constants; arguments as of `slips`.

    What varies may follow several targets of a tool that slips: they show how the flange moves at each pose,
    and nothing of the slip is left at the poses that were fitted. Constants cannot follow, and what varies is
    what they leave of a pose, which poses in no order scatter.
    """
    targets = len(found.selection.targets)
    frame = found.arm.frame_unknowns
    seen = Whitened.of(found, fitted, progress)
    if seen is None:
        return []
    seen = middles(seen, frame, targets)
    of_one = replace(found, selection=replace(found.selection, targets=found.selection.targets[:1]))
    sessions = [Tool(**vars(session), targets=targets) for session in sessions_of(of_one, fitted, seen)]
    return [slip for slip in slips_of(sessions) if slip.notice.kind == TARGET_SLIPPED]


@dataclass(frozen=True, eq=False)
class Tool(Session):
    """Visits of which the middle of so many targets is looked at."""

    targets: int = 1

    def step(self) -> Step | None:
        """As of one target: a step of it is one of all."""
        found = super().step()
        if found is None or found.shape.what != TARGET:
            return found
        shape = Shape(TARGET, tuple(range(self.targets)), found.shape.columns)
        return replace(found, shape=shape, sizes=np.tile(found.sizes[:AXES], self.targets))


def middles(seen: Whitened, frame: int, targets: int) -> Whitened:
    """Visits with the middle of the targets that each holds as its only one.

    Args:
        seen: The visits, v of them.
        frame: How many unknowns the frame has, the first of the set-up.
        targets: How many targets are fitted, three unknowns each behind these.
    """
    held = seen.held.reshape(len(seen.rows), -1, AXES)[:, :, 0].astype(np.float64)
    share = held / held.sum(axis=1, keepdims=True)
    middle = np.einsum("vt,ij->vitj", share, np.eye(AXES)).reshape(len(held), AXES, -1)
    size, back = AXES * len(held), np.linalg.inv(seen.root).reshape(*seen.left.shape, -1)
    back = (middle @ back).reshape(size, -1)
    root = np.linalg.cholesky(np.linalg.inv(back @ back.T)).T
    whitened = root @ back
    own, end = middle @ seen.setup, frame + AXES * targets
    alike = own[:, :, frame:end].reshape(len(held), AXES, targets, AXES).sum(axis=2)
    return Whitened(
        rows=seen.rows,
        left=(whitened @ seen.left.ravel()).reshape(len(held), AXES),
        shots=np.repeat(seen.shots.max(axis=1)[:, None], AXES, axis=1),
        root=root,
        taken=whitened @ seen.taken @ whitened.T,
        joints=middle @ seen.joints,
        single=np.einsum("via,va->vi", middle, seen.single),
        setup=np.concatenate([own[:, :, :frame], alike, own[:, :, end:]], axis=2),
        scaled=np.einsum("via,va->vi", middle, seen.scaled),
    )
