"""Acceleration schemes for fixed points x = G(x): each is only its update, the iteration loop is in fixed_point.py.

Notation: x_tilde = G(x), r = x_tilde - x. V holds differences of r, W differences of x_tilde, newest column first.

Protocol between the loop and a scheme:

* ``begin(fields)`` before the first evaluation of a call. History of earlier calls stays, the call's own starts empty.
* ``step(x, r)`` returns the next x. It is usable without begin and end; all entries then count as one field.
* ``end(status, x, r)`` after the last evaluation, with the pair that was tested but never went through ``step``.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

Field = slice | np.ndarray


class Scheme(Protocol):
    """What ``fixed_point`` asks of an acceleration scheme."""

    def begin(self, fields: Sequence[Field]) -> None: ...

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray: ...

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None: ...


@dataclass
class ConstantRelaxation:
    """Constant relaxation x <- x + omega r; omega = 1 is the explicit scheme x <- x_tilde."""

    omega: float = 1.0

    def __post_init__(self) -> None:
        _require_factor("omega", self.omega)

    def begin(self, fields: Sequence[Field]) -> None:
        pass

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Next x, same shape and unit."""
        return x + self.omega * r

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        pass


@dataclass
class Aitken:
    """Dynamic relaxation omega_k = -omega_{k-1} r_{k-1}.(r_k - r_{k-1}) / |r_k - r_{k-1}|^2  (Kuettler & Wall 2008).

    `omega` is the first factor of the first call. Later calls begin with sign(omega_last) min(|omega_last|, omega_max):
    the cap is on the magnitude, because a negative factor is the right one for a slope G' > 1. Within a call omega is
    free; an exact secant may need any value. One scalar cannot serve several fields of different stiffness.
    """

    omega: float = 0.5
    omega_max: float = 1.0
    _omega: float = field(init=False, repr=False)
    _r: np.ndarray | None = field(init=False, default=None, repr=False)

    def __post_init__(self) -> None:
        _require_factor("omega", self.omega)
        if not (math.isfinite(self.omega_max) and self.omega_max > 0.0):
            raise ValueError(f"omega_max must be positive and finite, got {self.omega_max}.")
        self._omega = self.omega

    def begin(self, fields: Sequence[Field]) -> None:
        self._r = None

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
        return x + self._omega * r

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        self._r = None
        if status == "diverged":
            self._omega = self.omega
        self._omega = math.copysign(min(abs(self._omega), self.omega_max), self._omega)


@dataclass
class IQNILS:
    """Interface quasi-Newton with an approximate inverse Jacobian from least squares (Degroote, Bathe, Vierendeels 2009).

        c = argmin |D (V c + r)|,   x <- x_tilde + W c

    `omega0` relaxes the very first update, while no column exists; `reuse` is the number q of earlier calls whose columns
    are kept; `filter` is the relative threshold of the QR2 filter: going from the newest column to the oldest, one is
    dropped for good when |v_orth| < filter |v|. D weighs every field f with 1/s_f, s_f = sum_k |r_f,k| / |r_k| over the
    coupling iterations of this call (residual-sum scaling), so that no unit matters.
    """

    omega0: float = 0.1
    reuse: int = 10
    filter: float = 1e-4
    _fields: tuple[Field, ...] = field(init=False, default=(slice(None),), repr=False)
    _V: list[np.ndarray] = field(init=False, default_factory=list, repr=False)
    _W: list[np.ndarray] = field(init=False, default_factory=list, repr=False)
    _blocks: deque = field(init=False, repr=False)
    _last: tuple[np.ndarray, np.ndarray] | None = field(init=False, default=None, repr=False)
    _sums: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        _require_factor("omega0", self.omega0)
