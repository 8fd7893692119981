"""QR decomposition of a set of columns that come one at a time and leave in the order in which they came.

A column costs four passes over Q to add instead of the 2 n k^2 operations of a new decomposition. Weights that are
constant over the n rows need no new one either: D V = Q (D R).
"""

from typing import Any

import numpy as np

# Part of a column, beyond those before it, that is rounding: it adds no direction.
ROUNDING = 1e-14


class Columns:
    """V = Q R with V (n, count), Q (n, rank) orthonormal and R (rank, count), columns from the oldest to the newest.

    Q is stored by its columns, `basis` (rank, n), and R as `factors` (rank, count).
    """

    def __init__(self) -> None:
        self._q = np.empty((0, 0))
        self._r = np.empty((0, 0))
        self.rank = 0
        self.count = 0

    @property
    def basis(self) -> np.ndarray:
        """Orthonormal vectors, (rank, n)."""
        return self._q[: self.rank]

    @property
    def factors(self) -> np.ndarray:
        """Components of the columns in the basis, (rank, count)."""
        return self._r[: self.rank, : self.count]

    def append(self, v: np.ndarray) -> None:
        """Add a column (n,): Gram-Schmidt twice, which is enough for orthogonality to rounding."""
        self._reserve(v.size)
        largest = float(np.max(np.abs(v), initial=0.0))
        if largest > 0.0:
            rest = v / largest  # no overflow or underflow in the squares
            size = np.linalg.norm(rest)
            Q = self.basis
            h = Q @ rest
            rest -= h @ Q
            correction = Q @ rest
            rest -= correction @ Q
            rho = np.linalg.norm(rest)
            self._r[: self.rank, self.count] = largest * (h + correction)
            if rho > ROUNDING * size and self.rank < len(self._q):
                self._q[self.rank] = rest / rho
                self._r[self.rank, self.count] = largest * rho
                self.rank += 1
        self.count += 1

    def drop(self, oldest: int) -> None:
        """Let the `oldest` first columns go. The basis shrinks with them, by one product (k x k) (k x n)."""
        if oldest <= 0:
            return
        if oldest >= self.count:
            self.__init__()  # type: ignore[misc]
            return
        Z, R = np.linalg.qr(self.factors[:, oldest:])
        basis = Z.T @ self.basis
        self.count -= oldest
        self.rank = len(R)
        self._q[: self.rank] = basis
        self._r[:] = 0.0
        self._r[: self.rank, : self.count] = R

    def matrix(self) -> np.ndarray:
        """The columns themselves, one a row, (count, n)."""
        out: np.ndarray = self.factors.T @ self.basis
        return out

    def __getstate__(self) -> dict[str, Any]:
        """Copies of the two factors, without the room for more."""
        return {"basis": self.basis.copy(), "factors": self.factors.copy(), "count": self.count}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._q, self._r = state["basis"], state["factors"]
        self.rank, self.count = len(self._q), state["count"]

    def _reserve(self, n: int) -> None:
        """Room for one more column, which doubles when it is used up."""
        if self.rank == len(self._q) and self.rank < n:
            grown = np.empty((min(max(8, 2 * self.rank), n), n))
            grown[: self.rank] = self._q[: self.rank] if self.rank else 0.0
            self._q = grown
        rows, room = self._r.shape
        if len(self._q) > rows or self.count == room:
            grown = np.zeros((max(len(self._q), rows), max(8, 2 * self.count, room)))
            grown[:rows, :room] = self._r
            self._r = grown
