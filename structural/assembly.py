"""Residual and tangent of a structure on a sparsity pattern and scatter maps that are built once."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from .chains import Chains, chain_energy, chain_forces, chain_forces_and_tangents
from .structure import (
    Loads,
    Structure,
    Unknowns,
    canonical_chains,
    canonical_panels,
    mirror_permutation,
    mirror_rows,
    unique_half,
    unknowns,
)
from .surface import surface_forces, surface_forces_and_tangents


def _dofs(nodes):
    """Dofs (e, 3m) of elements with nodes (e, m)."""
    return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])


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
        self.unknowns: Unknowns = unknowns(structure.nodes, structure.fixed, mirror)
        groups = [c.nodes for c in structure.chains]
        if mirror is None:
            self._rows = [(np.arange(len(g)), np.ones(len(g))) for g in groups]
            panels = np.arange(len(structure.panels)), np.ones(len(structure.panels))
        else:
            self._rows = [unique_half(mirror_rows(g, mirror, canonical_chains)) for g in groups]
            image = mirror_permutation(structure.surface @ structure.nodes)
            if image is None:
                raise ValueError("the interface surface is not mirror-symmetric although the structure is")
            panels = unique_half(mirror_rows(structure.panels, image, canonical_panels))
        self._panel_rows, self._panel_weight = panels
        self._corners = structure.panels[self._panel_rows]
        self._build_pattern()

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
        surface = self._surface_to_unknowns()
        load_rows, load_cols, load_panel, load_value = self._load_pairs(surface)
        r = np.concatenate([*rows, load_rows])
        c = np.concatenate([*cols, load_cols])
        inside = (r >= 0) & (c >= 0)
        key = np.where(inside, c * n + r, n * n)
        unique, where = np.unique(key, return_inverse=True)
        if unique[-1] == n * n:
            unique = unique[:-1]
        self._nnz = len(unique)
        self._indices = (unique % n).astype(np.int32)
        self._indptr = np.searchsorted(unique // n, np.arange(n + 1)).astype(np.int32)
        self.diagonal = where[:n]
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
        target = where[start:]
        keep = target < self._nnz
        self._load_stiffness = sp.csr_array(
            (load_value[keep], (target[keep], load_panel[keep])), shape=(self._nnz, 144 * len(self._corners))
        )
        self._load_forces = self._panel_forces_to_unknowns(surface)
        self._corner_map = sp.csr_array(self.structure.surface)[self._corners.reshape(-1)]

    def _surface_to_unknowns(self):
        """Constant derivative of the corner coordinates (12 p,) with respect to the unknowns, sparse (12 p, q)."""
        u, h = self.unknowns, sp.csr_array(self.structure.surface)
        free = u.index >= 0
        t = sp.csr_array((u.sign[free], (np.flatnonzero(free), u.index[free])), shape=(len(u.index), u.count))
        h3 = sp.kron(h[self._corners.reshape(-1)], sp.identity(3), format="csr")
        return sp.csr_array(h3 @ t)

    def _panel_forces_to_unknowns(self, surface):
        weight = np.repeat(self._panel_weight, 12)
        return sp.csr_array(surface.multiply(weight[:, None]).T)

    def _load_pairs(self, surface):
        """Entries that add each panel's load stiffness to the tangent: row, column, position in (p,12,12), factor."""
        entries = sp.coo_array(sp.csr_array(surface))
        row, column, value = entries.row, entries.col, entries.data
        panel = row // 12
        counts = np.bincount(panel, minlength=len(self._corners))
        begin = np.cumsum(counts) - counts
        partners = counts[panel]  # every entry meets all entries of its panel
        left = np.repeat(np.arange(len(row)), partners)
        right = begin[panel[left]] + np.arange(len(left)) - np.repeat(np.cumsum(partners) - partners, partners)
        position = 144 * panel[left] + 12 * (row[left] % 12) + row[right] % 12
        return column[left], column[right], position, value[left] * value[right] * self._panel_weight[panel[left]]

    def _parts(self, chains):
        return [c.select(rows) if len(rows) < len(c.l0) else c for c, (rows, _) in zip(chains, self._rows, strict=True)]

    def prepare(self, chains: tuple[Chains, ...], loads: Loads):
        """The chains and loads of the solved part, and the constant dead forces, for `residual` and `tangent`."""
        shear = None if loads.shear is None else loads.shear[self._panel_rows]
        weight = self.unknowns.gather(loads.dead)
        return self._parts(chains), loads.pressure[self._panel_rows], shear, weight

    def corners(self, x):
        """Corner points (p,4,3) of the solved panels at node positions x."""
        return (self._corner_map @ x).reshape(-1, 4, 3)

    def residual(self, q, prepared):
        """Internal minus external generalised forces (q,) N at the unknowns q, and the norm of the external ones."""
        chains, pressure, shear, weight = prepared
        x = self.unknowns.expand(q)
        internal = np.zeros(self.unknowns.count)
        for part, scatter in zip(chains, self._scatter_f, strict=True):
            internal += scatter(chain_forces(x, part))
        external = weight
        if len(self._corners):
            external = external + self._load_forces @ surface_forces(self.corners(x), pressure, shear).reshape(-1)
        return internal - external, self.unknowns.norm(external)

    def residual_and_tangent(self, q, prepared):
        """Residual (q,) N and consistent tangent (q,q) N/m, chains, load stiffness and all."""
        chains, pressure, shear, weight = prepared
        x = self.unknowns.expand(q)
        internal = np.zeros(self.unknowns.count)
        data = np.zeros(self._nnz)
        for part, sf, sk in zip(chains, self._scatter_f, self._scatter_k, strict=True):
            f, k = chain_forces_and_tangents(x, part)
            internal += sf(f)
            data += sk(k)
        external = weight
        if len(self._corners):
            f, k = surface_forces_and_tangents(self.corners(x), pressure, shear)
            external = external + self._load_forces @ f.reshape(-1)
            data -= self._load_stiffness @ k.reshape(-1)
        return internal - external, self.matrix(data), self.unknowns.norm(external)

    def matrix(self, data):
        """Sparse (q,q) matrix on the fixed pattern."""
        n = self.unknowns.count
        return sp.csc_array((data, self._indices, self._indptr), shape=(n, n))

    def energy(self, x, chains):
        """Strain energy J of all chains at node positions x (n,3)."""
        return sum(chain_energy(x, c) for c in chains)
