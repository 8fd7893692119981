"""Residual and tangent of a structure on a sparsity pattern and scatter maps that are built once."""

import copy
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from .carried import CarriedElements
from .chains import Chains, chain_energy, chain_forces, chain_forces_and_tangents
from .structure import (
    Loads,
    Structure,
    Unknowns,
    canonical_chains,
    canonical_panels,
    elimination_order,
    mirror_permutation,
    mirror_rows,
    unique_half,
    unknowns,
)
from .surface import (
    line_load_forces,
    line_load_forces_and_tangents,
    surface_forces,
    surface_forces_and_tangents,
)


def _dofs(nodes):
    """Dofs (e, 3m) of elements with nodes (e, m)."""
    return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])


def _couplings(structure, mirror):
    """Sparse incidences (elements, n) of the nodes that chains, panels and exposed lines couple.

    With a `mirror` permutation a node stands for its image too.
    """
    n = len(structure.nodes)
    surface = sp.csr_array(structure.surface)
    for elements, of_node in [(c.nodes, None) for c in structure.chains] + [
        (structure.panels, surface),
        (structure.lines, surface),
    ]:
        e, m = elements.shape
        columns = n if of_node is None else surface.shape[0]
        entries = np.ones(e * m), (np.repeat(np.arange(e), m), elements.ravel())
        incidence = sp.csr_array(entries, shape=(e, columns))
        incidence = incidence if of_node is None else sp.csr_array(incidence @ abs(of_node))
        yield incidence if mirror is None else incidence + incidence[:, mirror]


@dataclass(frozen=True, eq=False)
class _Scatter:
    """Where the values of element blocks go: targets in `data` or in the residual, with signs; pads go to a last
    bin.
    """

    target: np.ndarray
    sign: np.ndarray
    size: int

    def __call__(self, values):
        return np.bincount(self.target, self.sign * values.reshape(-1), minlength=self.size + 1)[: self.size]


class Assembly:
    """Residual (q,) N and tangent (q,q) N/m of a structure in its unknowns, for changing positions and loads."""

    def __init__(self, structure: Structure, mirror: np.ndarray | None = None):
        self.structure = structure
        order = elimination_order(_couplings(structure, mirror), ~structure.fixed.all(axis=1))
        self.unknowns: Unknowns = unknowns(structure.nodes, structure.fixed, mirror, order)
        groups = [c.nodes for c in structure.chains]
        if mirror is None:
            self._rows = [(np.arange(len(g)), np.ones(len(g))) for g in groups]
        else:
            self._rows = [unique_half(mirror_rows(g, mirror, canonical_chains)) for g in groups]
        image = None if mirror is None else self._surface_image()
        self._panels = self._carried(structure.panels, canonical_panels, image)
        self._lines = self._carried(structure.lines, canonical_chains, image)
        self._build_pattern()

    def _surface_image(self):
        image = mirror_permutation(self.structure.surface @ self.structure.nodes)
        if image is None:
            raise ValueError("the interface surface is not mirror-symmetric although the structure is")
        return image

    def _carried(self, nodes, canonical, image):
        """Rows of the loaded elements that are solved for, and these elements as the unknowns see them."""
        rows, weight = np.arange(len(nodes)), np.ones(len(nodes))
        if image is not None:
            rows, weight = unique_half(mirror_rows(nodes, image, canonical))
        return rows, CarriedElements(nodes[rows], weight, self.structure.surface, self.unknowns)

    def _build_pattern(self):
        u = self.unknowns
        n = u.count
        blocks = []
        for (rows, weight), chains in zip(self._rows, self.structure.chains, strict=True):
            d = _dofs(chains.nodes[rows])
            blocks.append((u.index[d], u.sign[d], weight))
        rows, cols = [np.arange(n)], [np.arange(n)]
        for index, _, _ in blocks:
            e, m = index.shape
            rows.append(np.broadcast_to(index[:, :, None], (e, m, m)).reshape(-1))
            cols.append(np.broadcast_to(index[:, None, :], (e, m, m)).reshape(-1))
        carried = [elements for _, elements in (self._panels, self._lines)]
        entries = [elements.stiffness_entries() for elements in carried]
        r = np.concatenate([*rows, *(e[0] for e in entries)])
        c = np.concatenate([*cols, *(e[1] for e in entries)])
        inside = (r >= 0) & (c >= 0)
        key = np.where(inside, c * n + r, n * n)
        unique, where = np.unique(key, return_inverse=True)
        if len(unique) and unique[-1] == n * n:
            unique = unique[:-1]
        self._nnz = len(unique)
        self._indices = (unique % n).astype(np.int32)
        self._indptr = np.searchsorted(unique // n, np.arange(n + 1)).astype(np.int32)
        self.diagonal = where[:n]
        self._empty = sp.csc_array((np.zeros(self._nnz), self._indices, self._indptr), shape=(n, n))
        self._scatter_k, self._scatter_f = [], []
        start = n
        for index, sign, weight in blocks:
            e, m = index.shape
            target = where[start : start + e * m * m]
            start += e * m * m
            pair = (weight[:, None, None] * sign[:, :, None] * sign[:, None, :]).reshape(-1)
            self._scatter_k.append(_Scatter(target, pair, self._nnz))
            flat = np.where(index >= 0, index, n).reshape(-1)
            self._scatter_f.append(_Scatter(flat, (weight[:, None] * sign).reshape(-1), n))
        self._load_stiffness = []
        for elements, (row, _, position, factor) in zip(carried, entries, strict=True):
            target = where[start : start + len(row)]
            start += len(row)
            self._load_stiffness.append(elements.stiffness_map(target, position, factor, self._nnz))

    def _parts(self, chains):
        return [c.select(rows) if len(rows) < len(c.l0) else c for c, (rows, _) in zip(chains, self._rows, strict=True)]

    def prepare(self, chains: tuple[Chains, ...], loads: Loads):
        """The chains and loads of the solved part, and the constant dead forces, for `residual` and `tangent`."""
        panels, lines = self._panels[0], self._lines[0]
        shear = None if loads.shear is None else loads.shear[panels]
        on_lines = np.zeros((len(lines), 3)) if loads.line_load is None else loads.line_load[lines]
        return self._parts(chains), (loads.pressure[panels], shear), on_lines, self.unknowns.gather(loads.dead)

    def residual(self, q, prepared):
        """Internal minus external generalised forces (q,) N at the unknowns q, and the norm of the external ones."""
        chains, on_panels, on_lines, external = prepared
        x = self.unknowns.expand(q)
        internal = np.zeros(self.unknowns.count)
        for part, scatter in zip(chains, self._scatter_f, strict=True):
            internal += scatter(chain_forces(x, part))
        for (_, elements), kernel, loads in (
            (self._panels, surface_forces, on_panels),
            (self._lines, line_load_forces, (on_lines,)),
        ):
            if elements.count:
                external = external + elements.generalised(kernel(elements.corners(x), *loads))
        return internal - external, self.unknowns.norm(external)

    def residual_and_tangent(self, q, prepared):
        """Residual (q,) N and consistent tangent (q,q) N/m, chains, load stiffness and all."""
        chains, on_panels, on_lines, external = prepared
        x = self.unknowns.expand(q)
        internal = np.zeros(self.unknowns.count)
        data = np.zeros(self._nnz)
        for part, sf, sk in zip(chains, self._scatter_f, self._scatter_k, strict=True):
            f, k = chain_forces_and_tangents(x, part)
            internal += sf(f)
            data += sk(k)
        for (_, elements), kernel, loads, stiffness in (
            (self._panels, surface_forces_and_tangents, on_panels, self._load_stiffness[0]),
            (self._lines, line_load_forces_and_tangents, (on_lines,), self._load_stiffness[1]),
        ):
            if elements.count:
                f, k = kernel(elements.corners(x), *loads)
                external = external + elements.generalised(f)
                data -= stiffness @ k.reshape(-1)
        return internal - external, self.matrix(data), self.unknowns.norm(external)

    def matrix(self, data):
        """Sparse (q,q) matrix on the fixed pattern, which all these matrices share."""
        matrix = copy.copy(self._empty)  # a constructor would check the pattern again, for longer than it takes to fill
        matrix.data = data
        return matrix

    def energy(self, x, chains):
        """Strain energy J of all chains at node positions x (n,3)."""
        return sum(chain_energy(x, c) for c in chains)
