"""A multilayer perceptron of the residual, by scikit-learn."""

from itertools import product
from typing import Any, Final

from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.methods.regressor import fit_regressor
from truearm.studies.accuracy.methods.searching import Effort
from truearm.studies.accuracy.methods.spaces import Kind
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats

SPACES: Final[tuple[Kind, ...]] = ("circles", "joints")
LAYERS: Final = ((16,), (64,), (32, 32))
ALPHAS: Final = (0.1, 1.0, 10.0, 100.0)
ITERATIONS: Final = 200


def fit_network(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """Layers and weight decay that predict best, of the joints or of their cosines and sines."""
    settings = [
        (space, {"layers": layers, "alpha": alpha})
        for space, layers, alpha in product(SPACES, LAYERS, ALPHAS)
    ]
    return fit_regressor(_make, effort.some(settings), poses, residuals, effort)


def _make(settings: dict[str, Any], seed: int) -> Any:  # noqa: ANN401
    from sklearn.neural_network import MLPRegressor  # noqa: PLC0415

    return MLPRegressor(
        hidden_layer_sizes=settings["layers"],
        activation="tanh",
        solver="lbfgs",
        alpha=settings["alpha"],
        max_iter=ITERATIONS,
        random_state=seed,
    )
