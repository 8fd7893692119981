"""What the coupling asks of a participant."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np


class Participant(Protocol):
    """A solver that exchanges named blocks of values and advances step by step.

    It may have derivatives too: `Blocks.directional_derivative`, where `offers_derivatives` is true.
    """

    @property
    def blocks(self) -> Mapping[str, tuple[int, ...]]:
        """Block name -> shape."""

    @property
    def causality(self) -> Mapping[str, str]:
        """Block name -> "input", "output", "parameter" or another causality of FMI."""

    def set(self, block: str, values: Any) -> None:
        """Give a new value to an input or a tunable parameter; ValueError in one sentence if it is not acceptable."""

    def step(self, t: float, dt: float) -> None:
        """Advance from t to t + dt [s]; StepFailed with the reason if the solver could not."""

    def get(self, block: str) -> np.ndarray:
        """A copy of the present value of a block, float64 of its shape."""

    def save(self) -> Any:
        """The complete state, to be given to restore any number of times and then to free."""

    def restore(self, state: Any) -> None:
        """Return to a saved state: the steps that follow give bitwise the same results."""

    def free(self, state: Any) -> None:
        """Give back what a saved state holds."""

    def serialised(self, state: Any) -> bytes:
        """A saved state for a file; ValueError in one sentence if that cannot be had."""

    def deserialised(self, data: bytes) -> Any:
        """A saved state of this participant, or of one made alike in another process, from its bytes."""

    def close(self) -> None:
        """End of use; what is still saved is freed."""
