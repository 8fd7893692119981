"""IQN-ILS: interface quasi-Newton with an inverse Jacobian from least squares."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from master.coupling.acceleration.columns import Columns
from master.coupling.acceleration.differences import QuasiNewton
from master.coupling.acceleration.scheme import Field, Kind, require_count, require_fraction, unit


@dataclass
class IQNILS(QuasiNewton):
    """Interface quasi-Newton, inverse Jacobian from least squares (Degroote, Bathe & Vierendeels 2009).

        c = argmin |D (V c + r)|,   x <- x_tilde + W c

    `omega0` relaxes the first update of all, while no column exists. `reuse` is the number q of earlier calls whose
    columns are kept; a difference is never taken across calls. V is orthogonalised from the newest column to the oldest
    (Gram-Schmidt, twice), and two tests leave a column out of an update:

    * QR2 filter: |v_orth| < `filter` |v|, relative, hence independent of units.
    * Consistency: |v_orth| < `curved` |v| (`stale` for columns of earlier calls) and |w_orth| / |v_orth| > max(1, the
      same of the columns taken so far). The quotient is what the inverse Jacobian does in a new direction, moderate for
      consistent data. Where v_orth is little more than the change of Jacobian since that column was taken, it is large
      and the column would do harm. So small but exact columns of linear problems stay, those that a curved map or an
      earlier call has made false go, and `filter` can be tight for both.

    For the weights D see `QuasiNewton`. V and W are kept as QR decompositions of each field, which grow by one column a
    coupling iteration; as D is constant in a field, the filter works on their small triangular factors, and an update
    costs O(n k) operations for k columns of n entries.
    """

    reuse: int = 10
    filter: float = 1e-8
    curved: float = 0.03
    stale: float = 0.02
    max_columns: int = 100
    _V: list[Columns] = field(init=False, repr=False)  # one a field, oldest column first
    _W: list[Columns] = field(init=False, repr=False)
    _blocks: deque[int] = field(init=False, repr=False)  # columns of each call, newest call first

    def __post_init__(self) -> None:
        super().__post_init__()
        require_count("reuse", self.reuse, 0)
        require_fraction("filter", self.filter)
        require_fraction("curved", self.curved)
        require_fraction("stale", self.stale)
        require_count("max_columns", self.max_columns, 1)
        self._forget()

    @property
    def columns(self) -> int:
        """Number of stored pairs (v, w), of this call and of the reused ones."""
        return sum(self._blocks)

    def _open(self) -> None:
        if self._blocks[0]:
            self._blocks.appendleft(0)
        self._trim()

    def _forget(self) -> None:
        self._V, self._W = ([Columns() for _ in self._fields] for _ in "VW")
        self._blocks = deque([0])

    def _refield(self, fields: tuple[Field, ...]) -> None:
        pairs = []
        if self.columns:
            for stored in (self._V, self._W):
                whole = np.empty((self.columns, self._size))
                for f, part in zip(self._fields, stored, strict=True):
                    whole[:, f] = part.matrix()
                pairs.append(whole)
        blocks, self._fields = self._blocks, fields
        self._forget()
        for v, w in zip(*pairs, strict=True):
            self._append(v, w)
        self._blocks = blocks

    def _insert(self, v: np.ndarray, w: np.ndarray) -> None:
        self._append(v, w)
        self._blocks[0] += 1
        self._trim()

    def _append(self, v: np.ndarray, w: np.ndarray) -> None:
        for f, own_v, own_w in zip(self._fields, self._V, self._W, strict=True):
            own_v.append(v[f])
            own_w.append(w[f])

    def _trim(self) -> None:
        """Drop the calls beyond `reuse`, and the oldest columns beyond `max_columns`."""
        surplus = 0
        while len(self._blocks) > self.reuse + 1:
            surplus += self._blocks.pop()
        while sum(self._blocks) > self.max_columns:
            last = min(self._blocks[-1], sum(self._blocks) - self.max_columns)
            surplus += last
            self._blocks[-1] -= last
            if not self._blocks[-1] and len(self._blocks) > 1:
                self._blocks.pop()
        for columns in (*self._V, *self._W):
            columns.drop(surplus)

    def _quasi_newton(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """W c of the filtered least squares: with orthonormal q_j and w_orth,j carried along, -sum w_orth,j (q_j.r)."""
        s = self._scales()
        v = np.concatenate([own.factors / s_f for own, s_f in zip(self._V, s, strict=True)])[:, ::-1].T
        w = np.concatenate([own.factors / s_f for own, s_f in zip(self._W, s, strict=True)])[:, ::-1].T
        known = [own.basis @ (r[f] / s_f) for f, own, s_f in zip(self._fields, self._V, s, strict=True)]
        u = unit(v, axis=1)[:, None]
        Q, G = self._filtered(v / u, w / u)
        self.record = {"columns": len(Q), "filtered": len(v) - len(Q)}
        c = Q @ np.concatenate(known)
        learnt = self._whole(self._W, -(c @ G), s)
        return learnt, r - self._whole(self._V, c @ Q, s) if self._careful < 1.0 else r

    def _whole(self, stored: list[Columns], components: np.ndarray, s: np.ndarray) -> np.ndarray:
        """A vector (n,) from its scaled components in the bases of all fields."""
        out = np.empty(self._size)
        at = 0
        for f, own, s_f in zip(self._fields, stored, s, strict=True):
            out[f] = s_f * (components[at : at + own.rank] @ own.basis)
            at += own.rank
        return out

    def _filtered(self, v: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q_j and w_orth,j of the columns that pass the tests, from all v and w (columns, components), newest first."""
        count, room = v.shape
        new = self._blocks[0]
        Q, G = np.empty((min(count, room), room)), np.empty((min(count, room), w.shape[1]))
        sizes = np.linalg.norm(v, axis=1)
        k, largest = 0, 1.0
        for j in range(count):
            if k == room:
                break
            q = v[j].copy()
            h = Q[:k] @ q
            q -= h @ Q[:k]
            correction = Q[:k] @ q
            q -= correction @ Q[:k]
            rho = np.linalg.norm(q)
            if not rho > self.filter * sizes[j]:
                continue
            g = (w[j] - (h + correction) @ G[:k]) / rho
            gain = float(np.linalg.norm(g))
            doubtful = j > 0 and rho < (self.curved if j < new else self.stale) * sizes[j]
            if doubtful and gain > largest:
                continue
            if j < new and not doubtful:
                largest = max(largest, gain)
            Q[k], G[k] = q / rho, g
            k += 1
        return Q[:k], G[:k]


KINDS = {
    "iqn-ils": Kind(
        IQNILS,
        {
            "omega0": IQNILS.omega0,
            "relaxed": IQNILS.relaxed,
            "reuse": 10,
            "filter": 1e-8,
            "curved": 0.03,
            "stale": 0.02,
            "max_columns": 100,
        },
        "omega0",
        "quasi-Newton with an inverse Jacobian from least squares",
        place=3,
    )
}
