"""IQN-IMVJ: interface quasi-Newton that corrects the inverse Jacobian of the call before."""

from dataclasses import dataclass, field

import numpy as np

from master.coupling.acceleration.differences import QuasiNewton
from master.coupling.acceleration.scheme import Field, Kind, require_count, require_fraction, unit


@dataclass(frozen=True, eq=False)
class _Block:
    """What one call has learnt: rows q_j D and D^-1 q_j of the orthonormal q_j of D V, and w_orth,j, each (k, n)."""

    weighted: np.ndarray
    basis: np.ndarray
    answers: np.ndarray


@dataclass
class IQNIMVJ(QuasiNewton):
    """Interface quasi-Newton with a multi-vector inverse Jacobian (Bogaers, Kok, Reddy & Franz 2014).

        J <- J_old + (W - J_old V) V^+,   x <- x_tilde - J r,   V^+ = (D V)^+ D

    J_old is the J with which the last call ended. It is never formed: J r is applied call by call, newest first, as
    W V^+ r + J_old (r - V V^+ r), with O(n) operations and numbers for each column of an earlier call; the k columns of
    this call are orthogonalised again at every update, O(n k^2). There is no number of calls to choose; only
    `max_columns` bounds what is kept, and the oldest calls go first. `omega0` relaxes the first update of all, `filter`
    and `curved` choose columns within a call as in `IQNILS`, for the weights D see `QuasiNewton`.
    """

    filter: float = 1e-8
    curved: float = 0.03
    max_columns: int = 200
    _pairs: list[tuple[np.ndarray, np.ndarray]] = field(init=False, repr=False)  # of this call, newest first
    _past: list[_Block] = field(init=False, repr=False)  # newest first

    def __post_init__(self) -> None:
        super().__post_init__()
        require_fraction("filter", self.filter)
        require_fraction("curved", self.curved)
        require_count("max_columns", self.max_columns, 1)
        self._forget()

    @property
    def columns(self) -> int:
        """Number of stored pairs (v, w), of this call and of earlier ones."""
        return len(self._pairs) + sum(len(block.basis) for block in self._past)

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        """See Scheme. What this call has learnt becomes part of the inverse Jacobian."""
        super().end(status, x, r)
        if self._pairs:
            self._past.insert(0, self._block(self._size))
            self._pairs = []
            self._trim()

    def _trim(self) -> None:
        """Drop the oldest calls beyond `max_columns`."""
        while self._past and self.columns > self.max_columns:
            self._past.pop()

    def _forget(self) -> None:
        self._pairs, self._past = [], []

    def _refield(self, fields: tuple[Field, ...]) -> None:
        """Nothing to do: what earlier calls learnt has its weights in it."""

    def _insert(self, v: np.ndarray, w: np.ndarray) -> None:
        self._pairs.insert(0, (v, w))
        del self._pairs[self.max_columns :]
        self._trim()

    def _quasi_newton(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rest, out = r.copy(), np.zeros_like(r)
        used = 0
        current = [self._block(r.size)] if self._pairs else []
        for block in (*current, *self._past):
            c = block.weighted @ rest
            rest -= c @ block.basis
            out -= c @ block.answers
            used += len(c)
        self.record = {"columns": used, "filtered": self.columns - used}
        return out, rest

    def _block(self, n: int) -> _Block:
        """Filtered decomposition of this call's columns."""
        D = np.empty(n)
        for f, s_f in zip(self._fields, self._scales(), strict=True):
            D[f] = 1.0 / s_f
        Q, G = np.empty((2, min(len(self._pairs), n), n))
        k, largest = 0, 1.0
        for j, (v, w) in enumerate(self._pairs):
            if k == n:
                break
            u = unit(v)
            q = D * (v / u)
            size = np.linalg.norm(q)
            h = Q[:k] @ q
            q -= h @ Q[:k]
            correction = Q[:k] @ q
            q -= correction @ Q[:k]
            rho = np.linalg.norm(q)
            if not rho > self.filter * size:
                continue
            g = (D * (w / u) - (h + correction) @ G[:k]) / rho
            gain = float(np.linalg.norm(g))
            doubtful = j > 0 and rho < self.curved * size
            if doubtful and gain > largest:
                continue
            if not doubtful:
                largest = max(largest, gain)
            Q[k], G[k] = q / rho, g
            k += 1
        return _Block(Q[:k] * D, Q[:k] / D, G[:k] / D)


KINDS = {
    "iqn-imvj": Kind(
        IQNIMVJ,
        {"omega0": IQNIMVJ.omega0, "relaxed": IQNIMVJ.relaxed, "filter": 1e-8, "curved": 0.03, "max_columns": 200},
        "omega0",
        "quasi-Newton that corrects the inverse Jacobian of the step before",
        place=4,
    )
}
