"""Pseudo-transient continuation (Kelley and Keyes 1998) of structure and flow, for coupled maps that jump.

Under loads that stay as they are a structure may have several equilibria, or only unstable ones where the coupled one
is stable: slack lines that stream in the wind, springs that push. The coupled map then jumps from one to another, and
no scheme finds its fixed point from afar, or keeps it. Steps in which damping holds nodes back lead to a stable one
continuously; the fixed point is the same, for there nothing moves.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from master.coupling.acceleration import Field

BLOCK = "pseudo_damping"  # N/m, of a structure that can be held back
# A structure that takes more Newton iterations than this in a step has sought its equilibrium from another start than
# the shape before (`structural.solve`); after so many of these in the last evaluations of a loop, the map jumps.
FAR, JUMPS, LAST = 200, 3, 30
# Factors of the damping after a step that is longer than the one before, and for a restart.
LONGER, CAREFUL = 2.0, 10.0


def jumping(history: list[dict[str, float]]) -> bool:
    """Whether the structure has jumped between equilibria in the last rows of a history."""
    spent = [row.get("structural.newton_iterations", 0.0) for row in history[-LAST:]]
    return sum(count > FAR for count in spent) >= JUMPS


class PseudoTime:
    """The scheme x <- x_tilde of a `structure` that is held back by `damping` N/m: implicit Euler steps in pseudo-time,
    which become shorter (more damping) where they grow.

    x must be where the structure is, which is held back from there; so there is no other relaxation.
    """

    def __init__(self, structure: Any, damping: float):
        self._structure, self._damping, self._length = structure, damping, np.inf

    @property
    def record(self) -> dict[str, float]:
        """See Scheme."""
        return {BLOCK: self._damping}

    def _hold_back(self, factor: float) -> None:
        self._damping *= factor
        self._structure.set(BLOCK, np.array(self._damping))

    def begin(self, fields: Sequence[Field]) -> None:
        """See Scheme."""
        self._hold_back(1.0)

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """See Scheme."""
        length = float(np.linalg.norm(r))
        if length > self._length:
            self._hold_back(LONGER)
        self._length = length
        return x + r

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        """See Scheme."""

    def restart(self) -> bool:
        """See Scheme."""
        self._length = np.inf
        self._hold_back(CAREFUL)
        return True
