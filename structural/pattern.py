"""The sparsity pattern of a structure's tangent and the maps that scatter element values into it, built once."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp


def dofs(nodes):
    """Dofs (e, 3m) of elements with nodes (e, m)."""
    return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])


def beam_dofs(beams, n):
    """Dofs (e, 12) of beams: position and spin of either end; spins follow those of n nodes."""
    ends = np.stack([beams.nodes[:, 0], n + beams.frames[:, 0], beams.nodes[:, 1], n + beams.frames[:, 1]], axis=1)
    return dofs(ends)


def couplings(structure, mirror):
    """Sparse incidences (elements, n) of the nodes that chains, beams, bending springs, panels and lines couple.

    A rider stands for the node that carries it; with a `mirror` permutation a node stands for its image too.
    """
    n = len(structure.nodes)
    stands_for = np.arange(n)
    stands_for[structure.riders] = structure.frames[structure.carriers]
    surface = sp.csr_array(structure.surface)
    for elements, of_node in [(c.nodes, None) for c in (*structure.chains, *structure.beams, *structure.bending)] + [
        (structure.exposed, None),
        (structure.panels, surface),
        (structure.lines, surface),
    ]:
        e, m = elements.shape
        columns = n if of_node is None else surface.shape[0]
        entries = np.ones(e * m), (np.repeat(np.arange(e), m), elements.ravel())
        incidence = sp.csr_array(entries, shape=(e, columns))
        incidence = incidence if of_node is None else sp.csr_array(incidence @ abs(of_node))
        if len(structure.riders):
            rides = sp.csr_array((np.ones(n), (np.arange(n), stands_for)), shape=(n, n))
            incidence = sp.csr_array(incidence @ rides)
        yield incidence if mirror is None else incidence + incidence[:, mirror]


@dataclass(frozen=True, eq=False)
class Scatter:
    """Where the values of element blocks go: targets in `data` or the residual, with signs; pads go to a last bin."""

    target: np.ndarray
    sign: np.ndarray
    size: int

    def __call__(self, values):
        return np.bincount(self.target, self.sign * values.reshape(-1), minlength=self.size + 1)[: self.size]


def pattern(rows, columns, n):
    """Keys column * n + row of the distinct entries inside (n,n), rising, and the place of every entry in them; their
    number for entries outside, which have a negative index.
    """
    inside = (rows >= 0) & (columns >= 0)
    key = np.where(inside, columns * n + rows, n * n)
    unique, where = np.unique(key, return_inverse=True)
    if len(unique) and unique[-1] == n * n:
        unique = unique[:-1]
    return unique, where


class Pattern:
    """Where everything goes: keys of the distinct entries of an (n,n) tangent, and the maps that scatter element values
    into them.

    `blocks` are (index (e,m), sign (e,m), weight (e,)) of groups of elements, `entries` (row, column) of single entries
    from elsewhere. `keys` rise, `diagonal` (n,) are the places of the diagonal, `stiffness` and `forces` the scatter
    maps of the groups, `places` those of the single entries.
    """

    def __init__(self, n, blocks, entries):
        rows, cols = [np.arange(n)], [np.arange(n)]
        for index, _, _ in blocks:
            e, m = index.shape
            rows.append(np.broadcast_to(index[:, :, None], (e, m, m)).reshape(-1))
            cols.append(np.broadcast_to(index[:, None, :], (e, m, m)).reshape(-1))
        r = np.concatenate([*rows, *(e[0] for e in entries)])
        c = np.concatenate([*cols, *(e[1] for e in entries)])
        self.keys, where = pattern(r, c, n)
        self.diagonal, start = where[:n], n
        self.stiffness: list[Scatter] = []
        self.forces: list[Scatter] = []
        self.places: list[np.ndarray] = []
        for index, sign, weight in blocks:
            e, m = index.shape
            target = where[start : start + e * m * m]
            start += e * m * m
            pair = (weight[:, None, None] * sign[:, :, None] * sign[:, None, :]).reshape(-1)
            self.stiffness.append(Scatter(target, pair, len(self.keys)))
            flat = np.where(index >= 0, index, n).reshape(-1)
            self.forces.append(Scatter(flat, (weight[:, None] * sign).reshape(-1), n))
        for row, _ in entries:
            self.places.append(where[start : start + len(row)])
            start += len(row)


def empty_matrix(keys, n):
    """Sparse (n,n) matrix of zeros with the entries of rising `keys` column * n + row."""
    indices = (keys % n).astype(np.int32) if n else np.zeros(0, np.int32)
    indptr = np.searchsorted(keys // max(n, 1), np.arange(n + 1)).astype(np.int32)
    return sp.csc_array((np.zeros(len(keys)), indices, indptr), shape=(n, n))
