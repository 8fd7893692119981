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
    """Interface quasi-Newton with an inverse Jacobian from least squares (Degroote, Bathe & Vierendeels 2009).

        c = argmin |D (V c + r)|,   x <- x_tilde + W c

    `omega0` relaxes the first update of all, while no column exists. `reuse` is the number q of earlier calls whose
    columns are kept; a difference is never taken across calls. V is orthogonalised from the newest column to the oldest
    (Gram-Schmidt, twice), and two tests leave a column out of an update:

    * QR2 filter: |v_orth| < `filter` |v|, relative, hence independent of units.
    * For columns of earlier calls: |v_orth| < `stale` |v| and |w_orth| / |v_orth| > max(1, the same of this call's
      columns). The quotient is what the inverse Jacobian does in a new direction, moderate for consistent data. Where
      v_orth is little more than the change of Jacobian since that call, it is large and the column would do harm. So
      small but exact columns of linear problems stay, small stale ones go, and `filter` can be tight for both.

    D weighs field f with 1/s_f, s_f the mean of |r_f| / |r| over the coupling iterations of this call (residual-sum
    scaling), but at least that of the call before: a field that starts converged must not get a boundless weight.
    """

    omega0: float = 0.1
    reuse: int = 10
    filter: float = 1e-8
    stale: float = 1e-4
    max_columns: int = 100
    _fields: tuple[Field, ...] = field(init=False, default=(slice(None),), repr=False)
    _blocks: deque = field(init=False, repr=False)  # newest call first; a block lists pairs (v, w), newest first
    _last: tuple[np.ndarray, np.ndarray] | None = field(init=False, default=None, repr=False)
    _shares: list[np.ndarray] = field(init=False, default_factory=list, repr=False)
    _floor: np.ndarray | float = field(init=False, default=0.0, repr=False)

    def __post_init__(self) -> None:
        _require_factor("omega0", self.omega0)
        if not (isinstance(self.reuse, int | np.integer) and self.reuse >= 0):
            raise ValueError(f"reuse must be a whole number of earlier calls >= 0, got {self.reuse}.")
        if not (math.isfinite(self.filter) and 0.0 <= self.filter < 1.0):
            raise ValueError(f"filter must be in [0, 1), got {self.filter}.")
        if not (math.isfinite(self.stale) and 0.0 <= self.stale < 1.0):
            raise ValueError(f"stale must be in [0, 1), got {self.stale}.")
        if not (isinstance(self.max_columns, int | np.integer) and self.max_columns >= 1):
            raise ValueError(f"max_columns must be a whole number >= 1, got {self.max_columns}.")
        self._blocks = deque([[]], maxlen=self.reuse + 1)

    @property
    def columns(self) -> int:
        """Number of stored pairs (v, w), of this call and of the reused ones."""
        return sum(len(block) for block in self._blocks)

    def begin(self, fields: Sequence[Field]) -> None:
        if len(fields) != len(self._fields):
            self._floor = 0.0
        self._fields = tuple(fields)
        self._last = None
        self._shares = []
        if self._blocks[0]:
            self._blocks.appendleft([])  # the deque lets the oldest go

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Next x = x_tilde + W c, same shape and unit."""
        self._add(x, r)
        norm = np.linalg.norm(r)
        if norm > 0.0:
            self._shares.append(np.array([np.linalg.norm(r[f]) for f in self._fields]) / norm)
        if not any(self._blocks):
            return x + self.omega0 * r
        return x + r + self._quasi_newton(r)

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        if status == "diverged":  # what led here is no guide for a restart
            self._blocks = deque([[]], maxlen=self.reuse + 1)
            self._floor = 0.0
        elif self._last is not None:
            self._add(x, r)
        if self._shares and status == "converged":
            self._floor = np.mean(self._shares, axis=0)
        self._last = None

    def _add(self, x: np.ndarray, r: np.ndarray) -> None:
        """Insert the differences to the last pair, unless they are zero, mere rounding of x, or not finite."""
        if self._last is not None:
            dx, v = x - self._last[0], r - self._last[1]
            w = x + r - (self._last[0] + self._last[1])
            moved = np.linalg.norm(dx) > 2.0 * np.finfo(float).eps * np.linalg.norm(x)
            if moved and np.any(v) and np.all(np.isfinite(v)) and np.all(np.isfinite(w)):
                self._blocks[0].insert(0, (v, w))
        self._last = (np.array(x), np.array(r))

    def _weights(self, n: int) -> np.ndarray:
        """1/s_f for the entries of each field, (n,)."""
        shares = np.mean(self._shares, axis=0) if self._shares else np.zeros(len(self._fields))
        D = np.ones(n)
        for f, s in zip(self._fields, np.maximum(shares, self._floor), strict=True):
            if s > 0.0:
                D[f] = 1.0 / s
        return D

    def _quasi_newton(self, r: np.ndarray) -> np.ndarray:
        """W c of the filtered least squares: with orthonormal q_j and w_orth,j carried along, -sum w_orth,j (q_j.r)."""
        n, new = r.size, len(self._blocks[0])
        if any(v.size != n for block in self._blocks for v, _ in block[:1]):
            raise ValueError(f"The stored columns do not have the {n} entries of x; pass a fresh IQNILS.")
        pairs = [pair for block in self._blocks for pair in block][: self.max_columns]
        D = self._weights(n)
        Q, G = np.empty((2, min(len(pairs), n), n))
        k, largest = 0, 1.0
        for j, (v, w) in enumerate(pairs):
            if k == n:
                break
            q = D * v
            size = np.linalg.norm(q)
            h = Q[:k] @ q
            q -= h @ Q[:k]
            correction = Q[:k] @ q
            q -= correction @ Q[:k]
            rho = np.linalg.norm(q)
            if not rho > self.filter * size:
                continue
            g = (D * w - (h + correction) @ G[:k]) / rho
            gain = float(np.linalg.norm(g))
            if j >= max(new, 1) and rho < self.stale * size and gain > largest:
                continue
            if j < new:
                largest = max(largest, gain)
            Q[k], G[k] = q / rho, g
            k += 1
        return -((Q[:k] @ (D * r)) @ G[:k]) / D


def _require_factor(name: str, value: float) -> None:
    if not (math.isfinite(value) and value != 0.0):
        raise ValueError(f"{name} must be finite and not zero, got {value}.")
