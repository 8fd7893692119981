"""Newton-Krylov on the interface: the exact Jacobian in every direction that is asked for, instead of a learnt one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from master.coupling.acceleration.scheme import Field, Kind, require_count, require_fraction, unit


@dataclass
class NewtonKrylov:
    """x <- x + d with (I - G'(x)) d = r, solved by GMRES with directional derivatives  (Eisenstat & Walker 1996).

    `product(v)` is G' v at the x that was evaluated last. The equation is solved to the relative residual
    min(`eta`, 0.9 (|r| / |r_before|)^2), which keeps the quadratic convergence of Newton's method and asks for few
    products far from the solution; `directions` bounds them. Several fields are scaled by their size |x_tilde_f|.
    """

    product: Callable[[np.ndarray], np.ndarray]
    eta: float = 0.01
    directions: int = 60
    record: dict[str, float] = field(init=False, default_factory=dict, repr=False)
    _fields: tuple[Field, ...] = field(init=False, default=(slice(None),), repr=False)
    _before: np.ndarray | None = field(init=False, default=None, repr=False)  # last residual of this call
    _careful: float = field(init=False, default=1.0, repr=False)

    def __post_init__(self) -> None:
        require_fraction("eta", self.eta)
        require_count("directions", self.directions, 1)

    def __getstate__(self) -> dict[str, Any]:
        """Without the product, which belongs to the participants."""
        return {k: v for k, v in self.__dict__.items() if k != "product"}

    def begin(self, fields: Sequence[Field]) -> None:
        """See Scheme."""
        self._fields, self._before = tuple(fields), None

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Next x, same shape and unit."""
        from scipy.sparse.linalg import LinearOperator, gmres  # loads slowly, and only this scheme needs it

        s = np.full_like(r, unit(r))
        if len(self._fields) > 1:
            for f in self._fields:
                s[f] = _size(x[f] + r[f]) or _size(r[f]) or 1.0
        count = 0

        def scaled(v: np.ndarray) -> np.ndarray:
            nonlocal count
            count += 1
            v = np.ravel(v)
            out: np.ndarray = v - self.product(s * v) / s
            return out

        eta = self.eta
        if self._before is not None and np.any(self._before):
            eta = min(eta, 0.9 * float(np.linalg.norm(r / s) / np.linalg.norm(self._before / s)) ** 2)
        eta = max(eta, 1e-12)
        self._before = np.array(r)
        operator = LinearOperator((r.size, r.size), matvec=scaled, dtype=float)
        most = min(self.directions, r.size)
        d, _ = gmres(operator, r / s, rtol=eta, atol=0.0, restart=most, maxiter=1)
        self.record = {"products": count}
        return x + self._careful * s * d

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        """See Scheme."""
        self._careful = 1.0

    def restart(self) -> bool:
        """Go on with steps of half the length, to the end of this call or of the next."""
        self._careful *= 0.5
        self._before = None
        return True


def _size(a: np.ndarray) -> float:
    """|a|_2 without overflow or underflow of the squares."""
    return unit(a) * float(np.linalg.norm(a / unit(a)))


KINDS = {
    "newton-krylov": Kind(
        NewtonKrylov,
        {"eta": 0.01, "directions": 60},
        "",
        "Newton with directional derivatives, solvers in-process only",
        exact=True,
        place=5,
    )
}
