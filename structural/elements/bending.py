"""Bending of rows of particles: springs on the second difference of three nodes, without rotational unknowns."""

from dataclasses import dataclass

import numpy as np

from .contract import ElementGroup


@dataclass(frozen=True, eq=False)
class BendingSprings(ElementGroup):
    """Springs that resist the bend at the middle one of three `nodes` (e,3).

    The bend is b = (x_a - x_b)/l_a + (x_c - x_b)/l_c with the rest distances `arms` (e,2) m, a vector whose length is
    the angle between the two arms while they keep their lengths; `k` (e,) N m per rad^2 is EI over the mean arm for
    a strip of bending stiffness EI N m^2; `rest` (e,) is the length of b without moment, 0 for a straight row. Energy
    k (|b| - rest)^2 / 2: with rest 0 quadratic, so convex, and its tangent constant (the bending energy of Bergou et
    al. 2006 for one row).
    """

    nodes: np.ndarray
    arms: np.ndarray
    k: np.ndarray
    rest: np.ndarray

    def __post_init__(self):
        if np.any(self.arms <= 0.0):
            raise ValueError("the arms of a bending spring must be longer than zero.")

    def properties(self):
        """See ElementGroup."""
        return {"bending stiffness": self.k, "rest bend": self.rest}

    def forces(self, at):
        """See ElementGroup."""
        return bending_forces(at.x, self)

    def forces_and_tangents(self, at):
        """See ElementGroup."""
        return bending_forces_and_tangents(at.x, self)

    def energy(self, at):
        """See ElementGroup."""
        return bending_energy(at.x, self)

    def stiffness(self, at):
        """See ElementGroup: of the middle node, which feels the bend most."""
        return self.k * (1.0 / self.arms).sum(axis=1) ** 2


def row_bending(nodes, x, stiffness):
    """Bending springs at the inner ones of a row of `nodes` (m,) at rest in the positions x (n,3) m.

    `stiffness` EI N m^2, one or (m - 2,).
    """
    nodes = np.asarray(nodes)
    triples = np.stack([nodes[:-2], nodes[1:-1], nodes[2:]], axis=1)
    return triple_bending(triples, x, stiffness)


def triple_bending(triples, x, stiffness):
    """Bending springs at the middle nodes of `triples` (e,3), at rest in the positions x (n,3) m; `stiffness` EI."""
    arms = np.linalg.norm(x[triples[:, [0, 2]]] - x[triples[:, 1]][:, None], axis=2)
    springs = BendingSprings(triples, arms, stiffness / arms.mean(axis=1), np.zeros(len(triples)))
    rest = np.linalg.norm(_bend(x, springs)[0], axis=1)
    return BendingSprings(triples, arms, springs.k, np.where(rest > 1e-9, rest, 0.0))


def quad_rows(quads):
    """Triples (t,3) of nodes that follow one another on the edges shared by neighbouring `quads` (p,4).

    Two quads with the common edge (b, c) continue both edges that end there: a-b-e and d-c-f. Every triple once.
    """
    sides: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for quad in np.asarray(quads).tolist():
        for i in range(4):
            before, b, c, after = quad[i - 1], quad[i], quad[(i + 1) % 4], quad[(i + 2) % 4]
            pair = ((b, before), (c, after))
            edge = (min(b, c), max(b, c))
            sides.setdefault(edge, []).extend(pair)
    found: dict[tuple[int, int, int], None] = {}
    for ends in sides.values():
        for n in range(0, len(ends), 2):
            for m in range(n + 2, len(ends), 2):
                for middle, a in ends[n : n + 2]:
                    for other, b in ends[m : m + 2]:
                        if middle == other:
                            found[min(a, b), middle, max(a, b)] = None
    return np.array(list(found), dtype=int).reshape(-1, 3)


def _bend(x, springs):
    """The bends b (e,3) and the weights (e,3) of the nodes in them."""
    near = 1.0 / springs.arms
    weights = np.stack([near[:, 0], -near.sum(axis=1), near[:, 1]], axis=1)
    return np.einsum("ei,eic->ec", weights, x[springs.nodes]), weights


def _force(b, springs):
    """Moment vectors k (|b| - rest) b / |b| (e,3), unit bends, and |b| where it is above zero, else 1."""
    size = np.sqrt(np.einsum("ec,ec->e", b, b))
    safe = np.where(size > 0.0, size, 1.0)
    unit = b / safe[:, None]
    per_bend = np.where(springs.rest > 0.0, springs.k * (1.0 - springs.rest / safe), springs.k)
    return per_bend[:, None] * b, unit, np.where(size > 0.0, per_bend, springs.k)


def bending_energy(x, springs):
    """Energy J of all springs at node positions x (n,3) m."""
    b, _ = _bend(x, springs)
    return float(0.5 * np.sum(springs.k * (np.sqrt(np.einsum("ec,ec->e", b, b)) - springs.rest) ** 2))


def bending_forces(x, springs):
    """Internal forces N (e,3,3) on the nodes of every spring: the gradient of its energy."""
    b, weights = _bend(x, springs)
    return weights[:, :, None] * _force(b, springs)[0][:, None, :]


def bending_forces_and_tangents(x, springs):
    """Internal forces N (e,3,3) and tangents N/m (e,9,9): w_i w_j (k u u^T + k (1 - rest/|b|) (I - u u^T))."""
    b, weights = _bend(x, springs)
    moment, unit, per_bend = _force(b, springs)
    block = (springs.k - per_bend)[:, None, None] * (unit[:, :, None] * unit[:, None, :])
    block += per_bend[:, None, None] * np.eye(3)
    tangent = np.einsum("ei,ej,eab->eiajb", weights, weights, block)
    return weights[:, :, None] * moment[:, None, :], tangent.reshape(len(b), 9, 9)
