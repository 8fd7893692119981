"""What quasi-Newton schemes share: the differences of iterates, field weights, and how a call begins and ends.

V holds differences of r, W differences of x_tilde; a difference is never taken across calls.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from master.coupling.acceleration.scheme import Field, require_count, require_factor, unit

# Factor on the steps in directions that are not known yet, each time a scheme restarts after it was led astray, and
# how it grows back to 1 with every fall of the residual.
CAREFUL, REGAINED = 0.25, 1.5
# First relaxation: the best factor for one eigenvalue lambda of the coupled map is 1 / (1 - lambda), 0.7 at -0.5 (the
# V3 kite at 12 m/s) and 0.15 at -6 (its design chord at 20 m/s); one in between serves both, and the tubes of the
# reference problems. Later updates do not depend on it where the map is linear.
FIRST_RELAXATION = 0.35


@dataclass
class QuasiNewton:
    """Base of the schemes that learn an inverse Jacobian; subclasses say what they do with a pair (v, w).

    While no column exists, `relaxed` updates of a call are relaxed by `omega0`, and differences between what they lead
    from are not kept: with more than one, what a strongly curved map does far from its fixed point teaches nothing.

    D weighs field f with 1/s_f, s_f the mean of |r_f| / |r| over the coupling iterations of this call (residual-sum
    scaling), but at least that of the call before: a field that starts converged must not get a boundless weight.
    """

    omega0: float = FIRST_RELAXATION
    relaxed: int = 1
    record: dict[str, float] = field(init=False, default_factory=dict, repr=False)
    _fields: tuple[Field, ...] = field(init=False, default=(slice(None),), repr=False)
    _last: tuple[np.ndarray, np.ndarray] | None = field(init=False, default=None, repr=False)
    _shares: np.ndarray = field(init=False, repr=False)
    _summands: int = field(init=False, default=0, repr=False)
    _floor: np.ndarray = field(init=False, repr=False)
    _careful: float = field(init=False, default=1.0, repr=False)
    _updates: int = field(init=False, default=0, repr=False)  # of this call while there were no columns
    _size: int = field(init=False, default=0, repr=False)  # entries of x that the columns have

    def __post_init__(self) -> None:
        require_factor("omega0", self.omega0)
        require_count("relaxed", self.relaxed, 1)
        self._shares, self._floor = np.zeros(1), np.zeros(1)

    @property
    def columns(self) -> int:
        """Number of stored pairs (v, w)."""
        raise NotImplementedError

    def begin(self, fields: Sequence[Field]) -> None:
        """See Scheme."""
        if not _same(fields, self._fields):
            last = max((int(np.max(f)) for f in fields if not isinstance(f, slice)), default=-1)
            if last >= self._size:
                self._require_size(last + 1)
            self._refield(tuple(fields))
            self._floor = np.zeros(len(fields))
        self._fields = tuple(fields)
        self._last, self._updates = None, 0
        self._shares, self._summands = np.zeros(len(fields)), 0
        self._open()

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Next x, same shape and unit."""
        own = r / unit(r)
        norm = np.linalg.norm(own)
        if self._last is not None and norm < np.linalg.norm(self._last[1] / unit(r)):  # the residual falls
            self._careful = min(1.0, REGAINED * self._careful)
        if not self.columns and self._updates < self.relaxed:
            self._last = None  # nothing is learnt yet
        self._learn(x, r)
        if norm > 0.0:
            self._shares = self._shares + np.array([np.linalg.norm(own[f]) for f in self._fields]) / norm
            self._summands += 1
        if not self.columns:
            self._updates += 1
            self.record = {"omega": self._careful * self.omega0, "columns": 0, "filtered": 0}
            return x + self._careful * self.omega0 * r
        self._require_size(x.size)
        learnt, rest = self._quasi_newton(r)
        return x + r + learnt - (1.0 - self._careful) * rest

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        """See Scheme. The last pair becomes a column too; what led to divergence is no guide and goes."""
        if status == "diverged":
            self._forget()
            self._floor = np.zeros(len(self._fields))
        elif self._last is not None:
            self._learn(x, r)
        if self._summands and status == "converged":
            self._floor = self._shares / self._summands
        self._last, self._careful = None, 1.0

    def restart(self) -> bool:
        """Restart without columns, with a quarter of the step in unknown directions, which grows back as residuals
        fall; until then, or to the end of this call or of the next.
        """
        self._forget()
        self._floor = np.zeros(len(self._fields))
        self._careful *= CAREFUL
        self._last = None
        return True

    def _learn(self, x: np.ndarray, r: np.ndarray) -> None:
        """Keep the differences to the last pair, unless they are zero, mere rounding of x, or not finite."""
        if self._last is not None:
            dx, v = x - self._last[0], r - self._last[1]
            w = x + r - (self._last[0] + self._last[1])
            u = unit(x) if np.any(x) else unit(dx)
            moved = np.linalg.norm(dx / u) > 2.0 * np.finfo(float).eps * np.linalg.norm(x / u)
            if moved and np.any(v) and np.all(np.isfinite(v)) and np.all(np.isfinite(w)):
                self._require_size(v.size)
                self._size = v.size
                self._insert(v, w)
        self._last = (np.array(x), np.array(r))

    def _require_size(self, n: int) -> None:
        """ValueError in one sentence if the columns have another number of entries."""
        if self.columns and self._size != n:
            kind = type(self).__name__
            raise ValueError(f"The stored columns do not have the {n} entries of x; pass a fresh {kind}.")

    def _scales(self) -> np.ndarray:
        """s_f of each field, positive, (fields,)."""
        shares = np.maximum(self._shares / max(self._summands, 1), self._floor)
        return np.where(shares > 0.0, shares, 1.0)

    def _open(self) -> None:
        """A call begins."""

    def _insert(self, v: np.ndarray, w: np.ndarray) -> None:
        """Take a pair (n,), (n,)."""
        raise NotImplementedError

    def _quasi_newton(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the columns add to x_tilde, W c, and the part of r that they do not know, r + V c (anything while no
        care is needed), (n,) each.
        """
        raise NotImplementedError

    def _forget(self) -> None:
        """Drop all columns."""
        raise NotImplementedError

    def _refield(self, fields: tuple[Field, ...]) -> None:
        """Sort the columns again, as the fields are others."""
        raise NotImplementedError


def _same(a: Sequence[Field], b: Sequence[Field]) -> bool:
    return len(a) == len(b) and all(map(_same_part, a, b))


def _same_part(a: Field, b: Field) -> bool:
    if isinstance(a, slice) or isinstance(b, slice):
        return isinstance(a, slice) and isinstance(b, slice) and a == b
    return np.array_equal(a, b)
