"""Schemes that scale the residual: x <- x + omega r."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from master.coupling.acceleration.scheme import Field, Kind, require_factor

CAREFUL = 0.5  # part of its first factor with which Aitken restarts


@dataclass
class ConstantRelaxation:
    """Constant relaxation x <- x + omega r; omega = 1 is the explicit scheme x <- x_tilde."""

    omega: float = 1.0

    def __post_init__(self) -> None:
        require_factor("omega", self.omega)

    @property
    def record(self) -> dict[str, float]:
        """See Scheme."""
        return {"omega": self.omega}

    def begin(self, fields: Sequence[Field]) -> None:
        """See Scheme."""

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Next x, same shape and unit."""
        return x + self.omega * r

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        """See Scheme."""

    def restart(self) -> bool:
        """The factor is what the caller wants; there is no other way."""
        return False


@dataclass
class Aitken:
    """Dynamic relaxation omega_k = -omega_{k-1} r_{k-1}.(r_k - r_{k-1}) / |r_k - r_{k-1}|^2  (Kuettler & Wall 2008).

    `omega` is the first factor of the first call. Later calls begin with sign(omega_last) min(|omega_last|, omega_max):
    the cap is on the magnitude, because a negative factor is the right one for a slope G' > 1. Within a call omega is
    free; an exact secant may need any value. One scalar cannot serve several fields of different stiffness.
    """

    omega: float = 0.5
    omega_max: float = 1.0
    record: dict[str, float] = field(init=False, default_factory=dict, repr=False)
    _omega: float = field(init=False, repr=False)
    _careful: float = field(init=False, default=1.0, repr=False)
    _r: np.ndarray | None = field(init=False, default=None, repr=False)

    def __post_init__(self) -> None:
        require_factor("omega", self.omega)
        if not (math.isfinite(self.omega_max) and self.omega_max > 0.0):
            raise ValueError(f"omega_max must be positive and finite, got {self.omega_max}.")
        self._omega = self.omega

    def begin(self, fields: Sequence[Field]) -> None:
        """See Scheme."""
        self._r, self._careful = None, 1.0

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Next x = x + omega r, same shape and unit."""
        if self._r is not None:
            scale = np.max(np.abs(self._r), initial=0.0) or 1.0  # no overflow or underflow in the squares
            previous = self._r / scale
            dr = r / scale - previous
            denominator = float(dr @ dr)
            if denominator > 0.0:
                omega = -self._omega * float(previous @ dr) / denominator
                if math.isfinite(omega) and omega != 0.0:
                    self._omega = omega
        self._r = np.array(r)
        self.record = {"omega": self._omega}
        return x + self._omega * r

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        """See Scheme."""
        self._r = None
        if status == "diverged":
            self._omega = self.omega
        self._omega = math.copysign(min(abs(self._omega), self.omega_max), self._omega)

    def restart(self) -> bool:
        """Restart with half of the factor of the last start."""
        self._careful *= CAREFUL
        self._omega, self._r = self._careful * self.omega, None
        return True


KINDS = {
    "explicit": Kind(lambda: ConstantRelaxation(1.0), {}, "", "staggered exchange, x <- x~", place=0),
    "relaxation": Kind(ConstantRelaxation, {"omega": 0.25}, "omega", "constant relaxation, x <- x + omega r", place=1),
    "aitken": Kind(Aitken, {"omega": 0.5, "omega_max": 1.0}, "omega", "relaxation by the last two residuals", place=2),
}
