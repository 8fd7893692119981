"""Where a communication step begins to look: what is sent back, extrapolated in time."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

PREDICTORS = ("constant", "linear", "quadratic")


@dataclass
class Predictor:
    """Start of a communication step: extrapolation of the last accepted unknowns in time, of degree 0, 1 or 2.

    While there are fewer accepted steps than the degree asks for, it is the highest that they allow.
    """

    kind: str = "linear"
    _times: deque[float] = field(init=False, repr=False)
    _values: deque[np.ndarray] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in PREDICTORS:
            raise ValueError(f"there is no predictor '{self.kind}'; choose one of: {', '.join(PREDICTORS)}.")
        self._times, self._values = (deque(maxlen=PREDICTORS.index(self.kind) + 1) for _ in range(2))

    def add(self, time: float, x: np.ndarray) -> None:
        """Take the accepted unknowns (n,) at a time s."""
        self._times.append(time)
        self._values.append(np.array(x))

    def at(self, time: float) -> np.ndarray:
        """The unknowns (n,) expected at a time s (Lagrange)."""
        t = np.array(self._times)
        weights = [np.prod([(time - b) / (a - b) for j, b in enumerate(t) if j != i]) for i, a in enumerate(t)]
        return np.sum([w * x for w, x in zip(weights, self._values, strict=True)], axis=0)

    def known(self) -> list[tuple[float, np.ndarray]]:
        """Times s and accepted unknowns (n,), oldest first."""
        return list(zip(self._times, self._values, strict=True))

    def forget(self) -> None:
        """Keep only the last accepted unknowns."""
        while len(self._times) > 1:
            self._times.popleft()
            self._values.popleft()
