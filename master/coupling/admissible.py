"""Which values unknowns may have: whole numbers are passed on as they are sent, bounds of inputs are kept."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from master.coupling.acceleration import Field


@dataclass(frozen=True, eq=False)
class Admissible:
    """What is known of each entry of x (n,): whether it is `whole`, a truth value, a count or an item of an enumeration
    that nothing may relax, predict or accelerate; and the bounds `low` and `high` of the inputs it goes to.
    """

    whole: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @property
    def restricts(self) -> bool:
        """Whether anything is not allowed."""
        return bool(self.whole.any() or np.isfinite(self.low).any() or np.isfinite(self.high).any())

    def clipped(self, x: np.ndarray, sent: np.ndarray) -> np.ndarray:
        """x within the bounds, and whole numbers as they were `sent`. What was sent is allowed even beyond the bounds:
        what it means is for the participant to say.
        """
        x = np.clip(x, np.minimum(self.low, sent), np.maximum(self.high, sent))
        return np.where(self.whole, sent, x)

    def free(self, x: np.ndarray) -> np.ndarray:
        """The entries of x that are no whole numbers."""
        return x[~self.whole] if self.whole.any() else x

    def free_parts(self, parts: Sequence[Field]) -> list[Field]:
        """The index sets of the fields that are no whole numbers, in `free`; a field is of one kind."""
        if not self.whole.any():
            return list(parts)
        place = np.cumsum(~self.whole) - 1
        entries = [np.arange(self.whole.size)[part] for part in parts]
        found: list[Field] = []
        for part, own in zip(parts, entries, strict=True):
            if not self.whole[own].any():
                new = place[own]
                found.append(slice(int(new[0]), int(new[-1]) + 1) if isinstance(part, slice) else new)
        return found
