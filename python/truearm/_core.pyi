"""The compiled core. Private: the package's modules wrap it."""

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

__version__: str

class CoreError(ValueError):
    """The core refused its input; the message says the value, the rule and the way out."""

@final
class Chain:
    """A serial chain: base, L links with J joints, end.

    Parameters are ordered by link, within a link theta, d, a, alpha, beta (rad and m); joint values are
    Denavit-Hartenberg ones, added to theta (revolute) or d (prismatic) of their links. Arrays are float64 and
    C-contiguous. `parameters` are absolute: the links' own (None), (L, 5) for all poses, or (n, L, 5).
    Results go to `out` if it is given, which costs far less than a large new array. `threads` bounds the threads used
    (None: all); the result does not depend on it.

    Raises:
        CoreError: A shape does not fit, an array is not contiguous, a transform is not rigid.
    """

    def __init__(
        self,
        convention: str,
        joints: Sequence[str],
        links: NDArray[np.float64],
        base: NDArray[np.float64],
        end: NDArray[np.float64],
    ) -> None:
        """Make a chain.

        Args:
            convention: "standard", A = Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), or "modified",
                A = Rx(alpha) Tx(a) Ry(beta) Rz(theta) Tz(d).
            joints: For each link "revolute", "prismatic" or "fixed".
            links: (L, 5) parameters.
            base: (4, 4) transform before the first link.
            end: (4, 4) transform after the last link: flange and tool.
        """

    @property
    def joint_count(self) -> int:
        """J, the number of links that are not fixed."""

    @property
    def link_count(self) -> int:
        """L, the number of links."""

    def position(
        self,
        q: NDArray[np.float64],
        parameters: NDArray[np.float64] | None = None,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Origin of the end in the base frame, (n, 3), of joint values q, (n, J)."""

    def pose(
        self,
        q: NDArray[np.float64],
        parameters: NDArray[np.float64] | None = None,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """base_from_end, (n, 4, 4), of joint values q, (n, J)."""

    def parameter_jacobian(
        self,
        q: NDArray[np.float64],
        parameters: NDArray[np.float64] | None = None,
        pose: bool = False,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Derivative with respect to all parameters, (n, 3, 5 L), or (n, 6, 5 L) with `pose`.

        Rows 0 to 2 are the position, 3 to 5 the rotation vector w in the base frame: R becomes exp(w) R.
        """

    def joint_jacobian(
        self,
        q: NDArray[np.float64],
        parameters: NDArray[np.float64] | None = None,
        pose: bool = False,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Derivative with respect to the joint values, (n, 3, J), or (n, 6, J) with `pose`; rows as above."""
