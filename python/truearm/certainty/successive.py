"""What updates, one after another, made of the errors that a calibration had before them all."""

from dataclasses import dataclass

import numpy as np

from truearm.certainty.threes import repeated, threes
from truearm.revision import Carried
from truearm.types import Floats


@dataclass(frozen=True, eq=False)
class Successive:
    """Updates as one map of the errors before the first of them, which is asked of nothing else.

    A row with derivatives J by the arm's parameters and s by the unknowns of the S set-ups after the last
    update is off by `e(J, s tied) + u (w - response e(shown))`, with e the errors before the first update and
    `u = J of_arm + s of_setups` the derivatives by the U unknowns of all updates.

    Attributes:
        of_arm: (5 L, U).
        of_setups: (S, U).
        response: How the unknowns follow the 3 R values that the rows of all updates show (U, 3 R).
        own: Covariance (U, U) of w, SI.
        inputs: Of the field at these rows, three values at a time (R, I).
        jacobian: Derivatives (R, 3, 5 L) of what they show by the arm's parameters.
        setup: The same (R, 3, S') by the set-ups before the first update.
        tied: One where an unknown of the last set-ups is tied to one of those before the first (S, S').
    """

    of_arm: Floats
    of_setups: Floats
    response: Floats
    own: Floats
    inputs: Floats
    jacobian: Floats
    setup: Floats
    tied: Floats

    @classmethod
    def one(cls, offsets: Floats, carried: Carried) -> "Successive":
        """One update, with derivatives (5 L, u) of the arm's parameters by what it estimated of the arm."""
        arm, setups = offsets.shape[1], len(carried.tied)
        return cls(
            of_arm=np.hstack([offsets, np.zeros((len(offsets), setups))]),
            of_setups=np.hstack([np.zeros((setups, arm)), np.eye(setups)]),
            response=carried.response,
            own=carried.own,
            inputs=repeated(carried.inputs, carried.jacobian),
            jacobian=threes(carried.jacobian),
            setup=threes(carried.setup),
            tied=carried.tied,
        )

    def then(self, later: "Successive") -> "Successive":
        """These and, after them, one more.

        What shows in the later rows is what these updates left of the errors before them.
        """
        from scipy.linalg import block_diag  # noqa: PLC0415 - slow to import

        shown = self.unknown_to(later.jacobian, later.setup).reshape(-1, len(self.own))
        onward = np.eye(len(self.own) + len(later.own))
        onward[len(self.own) :, : len(self.own)] = -later.response @ shown
        return Successive(
            of_arm=np.hstack([self.of_arm, later.of_arm]),
            of_setups=np.hstack([later.tied @ self.of_setups, later.of_setups]),
            response=onward @ block_diag(self.response, later.response),
            own=onward @ block_diag(self.own, later.own) @ onward.T,
            inputs=np.concatenate([self.inputs, later.inputs]),
            jacobian=np.concatenate([self.jacobian, later.jacobian]),
            setup=np.concatenate([self.setup, later.setup @ self.tied]),
            tied=later.tied @ self.tied,
        )

    def unknown_to(self, jacobian: Floats, setup: Floats | None) -> Floats:
        """Derivatives (n, m, U) by the unknowns of all updates: without set-ups those of the arm."""
        of_arm = jacobian @ self.of_arm
        return np.asarray(of_arm if setup is None else of_arm + setup @ self.of_setups)

    def tied_to(self, jacobian: Floats, setup: Floats | None) -> Floats:
        """Derivatives (n, m, S') by the set-ups before the first update, of those (n, m, S) by the last."""
        return np.zeros((*jacobian.shape[:2], self.tied.shape[1])) if setup is None else setup @ self.tied

    def with_shown(self, inputs: Floats, jacobian: Floats, tied: Floats) -> tuple[Floats, Floats, Floats]:
        """Inputs and rows, three at a time, and behind them those of the updates."""
        at, of_arm = np.concatenate([repeated(inputs, jacobian), self.inputs]), threes(jacobian)
        of_setup = np.concatenate([threes(tied), self.setup])
        return at, np.concatenate([of_arm, self.jacobian]), of_setup
