"""Residual and tangent of a structure on a sparsity pattern and scatter maps that are built once."""

import copy
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from .beams import Beams, beam_forces, beam_forces_and_tangents
from .carried import CarriedElements
from .chains import Chains, chain_energy, chain_forces, chain_forces_and_tangents
from .links import RigidLinks
from .rotations import spin, turned
from .structure import (
    Loads,
    Structure,
    canonical_chains,
    canonical_panels,
    elimination_order,
    mirror_permutation,
    mirror_rows,
    unique_half,
)
from .surface import (
    line_load_forces,
    line_load_forces_and_tangents,
    surface_forces,
    surface_forces_and_tangents,
)
from .unknowns import Unknowns, unknowns


def _dofs(nodes):
    """Dofs (e, 3m) of elements with nodes (e, m)."""
    return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])


def _beam_dofs(beams, n):
    """Dofs (e, 12) of beams: position and spin of either end; spins follow those of n nodes."""
    ends = np.stack([beams.nodes[:, 0], n + beams.frames[:, 0], beams.nodes[:, 1], n + beams.frames[:, 1]], axis=1)
    return _dofs(ends)


def _couplings(structure, mirror):
    """Sparse incidences (elements, n) of the nodes that chains, beams, panels and exposed lines couple.

    A rider stands for the node that carries it; with a `mirror` permutation a node stands for its image too.
    """
    n = len(structure.nodes)
    stands_for = np.arange(n)
    stands_for[structure.riders] = structure.frames[structure.carriers]
    surface = sp.csr_array(structure.surface)
    for elements, of_node in [(c.nodes, None) for c in (*structure.chains, *structure.beams)] + [
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
class _Scatter:
    """Where the values of element blocks go: targets in `data` or the residual, with signs; pads go to a last bin."""

    target: np.ndarray
    sign: np.ndarray
    size: int

    def __call__(self, values):
        return np.bincount(self.target, self.sign * values.reshape(-1), minlength=self.size + 1)[: self.size]


def _pattern(rows, columns, n):
    """Keys column * n + row of the distinct entries inside (n,n), rising, and the place of every entry in them; their
    number for entries outside, which have a negative index.
    """
    inside = (rows >= 0) & (columns >= 0)
    key = np.where(inside, columns * n + rows, n * n)
    unique, where = np.unique(key, return_inverse=True)
    if len(unique) and unique[-1] == n * n:
        unique = unique[:-1]
    return unique, where


class Assembly:
    """Residual (q,) and tangent (q,q) of a structure in its unknowns, for changing positions, rotations and loads.

    Forces N and moments N m, per m and per rad. The unknowns are q for positions; rotations (r,3,3) of the frames, left
    out where there are none, go beside them, and `moved` makes both from a step.
    """

    def __init__(self, structure: Structure, mirror: np.ndarray | None = None):
        self.structure = structure
        free = np.array(~structure.fixed.all(axis=1))
        free[structure.riders] = False
        free[structure.frames[~structure.clamped.all(axis=1)]] = True
        order = elimination_order(_couplings(structure, mirror), free)
        self.unknowns: Unknowns = unknowns(structure, mirror, order)
        riding = len(structure.riders) > 0
        self._wide = unknowns(structure, mirror, order, with_riders=True) if riding else self.unknowns
        self._links = RigidLinks(structure, self._wide, self.unknowns) if riding else None
        self._rows = [self._half(c, mirror) for c in structure.chains]
        self._beam_rows = [self._half(b, mirror) for b in structure.beams]
        image = None if mirror is None else self._surface_image()
        self._panels = self._carried(structure.panels, canonical_panels, image)
        self._lines = self._carried(structure.lines, canonical_chains, image)
        self._build_pattern()

    @staticmethod
    def _half(group, mirror):
        if mirror is None:
            return np.arange(len(group.nodes)), np.ones(len(group.nodes))
        return unique_half(mirror_rows(group.nodes, mirror, canonical_chains))

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
        return rows, CarriedElements(nodes[rows], weight, self.structure.surface, self._wide)

    def _build_pattern(self):
        u, s = self._wide, self.structure
        n = u.count
        blocks = []
        for (rows, weight), chains in zip(self._rows, s.chains, strict=True):
            d = _dofs(chains.nodes[rows])
            blocks.append((u.index[d], u.sign[d], weight))
        for (rows, weight), beams in zip(self._beam_rows, s.beams, strict=True):
            d = _beam_dofs(beams.select(rows), len(s.nodes))
            blocks.append((u.index[d], u.sign[d], weight))
        spins = _dofs(len(s.nodes) + np.arange(len(s.frames))[:, None])  # for the skew part of applied moments
        blocks.append((u.index[spins], u.sign[spins], np.ones(len(spins))))
        rows, cols = [np.arange(n)], [np.arange(n)]
        for index, _, _ in blocks:
            e, m = index.shape
            rows.append(np.broadcast_to(index[:, :, None], (e, m, m)).reshape(-1))
            cols.append(np.broadcast_to(index[:, None, :], (e, m, m)).reshape(-1))
        carried = [elements for _, elements in (self._panels, self._lines)]
        entries = [elements.stiffness_entries() for elements in carried]
        r = np.concatenate([*rows, *(e[0] for e in entries)])
        c = np.concatenate([*cols, *(e[1] for e in entries)])
        unique, where = _pattern(r, c, n)
        self._nnz = len(unique)
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
        self._scatter_f.pop()
        self._scatter_skew = self._scatter_k.pop()
        self._load_stiffness = []
        for elements, (row, _, position, factor) in zip(carried, entries, strict=True):
            target = where[start : start + len(row)]
            start += len(row)
            self._load_stiffness.append(elements.stiffness_map(target, position, factor, self._nnz))
        if self._links is not None:
            q = self.unknowns.count
            r, c = self._links.pattern(unique % n, unique // n)
            unique, self._reduced = _pattern(np.append(r, np.arange(q)), np.append(c, np.arange(q)), q)
            self.diagonal, self._reduced = self._reduced[-q:] if q else self._reduced[:0], self._reduced[: len(r)]
            n = q
        else:
            self.diagonal = where[:n]
        indices = (unique % n).astype(np.int32) if n else np.zeros(0, np.int32)
        indptr = np.searchsorted(unique // max(n, 1), np.arange(n + 1)).astype(np.int32)
        self._empty = sp.csc_array((np.zeros(len(unique)), indices, indptr), shape=(n, n))

    def _parts(self, groups, rows):
        return [g.select(r) if len(r) < len(g.l0) else g for g, (r, _) in zip(groups, rows, strict=True)]

    def prepare(self, chains: tuple[Chains, ...], loads: Loads, beams: tuple[Beams, ...] | None = None):
        """The elements and loads of the solved part, and the constant dead forces, for `residual` and `tangent`.

        Without `beams` those of the structure.
        """
        beams = self.structure.beams if beams is None else beams
        elements = self._parts(chains, self._rows), self._parts(beams, self._beam_rows)
        return elements, *self._seen(loads)

    def _seen(self, loads):
        """Loads on the panels and lines that are solved for, dead forces (w,), and the skew stiffness of moments."""
        panels, lines = self._panels[0], self._lines[0]
        shear = None if loads.shear is None else loads.shear[panels]
        on_lines = np.zeros((len(lines), 3)) if loads.line_load is None else loads.line_load[lines]
        dead, skew = self._wide.gather(loads.dead), None
        if loads.moment is not None:
            dead = dead + self._wide.gather(np.concatenate([0.0 * loads.dead, loads.moment]))
            skew = self._scatter_skew(-0.5 * spin(loads.moment))
        return (loads.pressure[panels], shear), on_lines, dead, skew

    def start(self, rotations=None):
        """Rotations (r,3,3) to begin with: given ones, or those of the reference configuration; None without frames."""
        if not len(self.structure.frames):
            return None
        return self.structure.unturned if rotations is None else rotations

    def moved(self, q, rotations, step):
        """Unknowns and rotations after a `step` (q,), m and rad."""
        return q + step, None if rotations is None else turned(rotations, self.unknowns.spins(step))

    def positions(self, q, rotations=None):
        """Node positions (n,3) m, riders and all."""
        x = self.unknowns.expand(q)
        if self._links is not None:
            self._links.place(x, self.start(rotations), self.structure.frames)
        return x

    def residual(self, q, prepared, rotations=None):
        """Internal minus external generalised forces (q,) N at the unknowns q, and the norm of the external ones."""
        (chains, beams), on_panels, on_lines, external, _ = prepared
        x, rotations = self.positions(q, rotations), self.start(rotations)
        internal = np.zeros(self._wide.count)
        forces = [chain_forces(x, part) for part in chains] + [beam_forces(x, rotations, part) for part in beams]
        for values, scatter in zip(forces, self._scatter_f, strict=True):
            internal += scatter(values)
        external = self._external(x, on_panels, on_lines, external)
        if self._links is not None:
            factors, _ = self._links.factors(rotations)
            internal, external = (self._links.forces(f, factors) for f in (internal, external))
        return internal - external, self.unknowns.norm(external)

    def _external(self, x, on_panels, on_lines, dead):
        for (_, elements), kernel, loads in (
            (self._panels, surface_forces, on_panels),
            (self._lines, line_load_forces, (on_lines,)),
        ):
            if elements.count:
                dead = dead + elements.generalised(kernel(elements.corners(x), *loads))
        return dead

    def load_forces(self, x, loads, rotations=None):
        """Generalised forces (q,) N of the loads alone at node positions x (n,3) m: linear in the loads."""
        *on_surface, dead, _ = self._seen(loads)
        external = self._external(x, *on_surface, dead)
        if self._links is None:
            return external
        return self._links.forces(external, self._links.factors(self.start(rotations))[0])

    def moves(self, step, rotations=None):
        """Displacements (n,3) m of the nodes, riders and all, in a small `step` (q,): the derivative of `positions`."""
        dx = self.unknowns.moves(step)
        if self._links is not None:
            self._links.carry(dx, self.unknowns.spins(step), self.start(rotations), self.structure.frames)
        return dx

    def residual_and_tangent(self, q, prepared, rotations=None):
        """Residual (q,) N and consistent tangent (q,q) N/m, elements, links, load stiffness and all."""
        (chains, beams), on_panels, on_lines, external, skew = prepared
        x, rotations = self.positions(q, rotations), self.start(rotations)
        internal = np.zeros(self._wide.count)
        data = np.zeros(self._nnz) if skew is None else skew
        both = [chain_forces_and_tangents(x, part) for part in chains]
        both += [beam_forces_and_tangents(x, rotations, part) for part in beams]
        for (f, k), sf, sk in zip(both, self._scatter_f, self._scatter_k, strict=True):
            internal += sf(f)
            data = data + sk(k)
        for (_, elements), kernel, loads, stiffness in (
            (self._panels, surface_forces_and_tangents, on_panels, self._load_stiffness[0]),
            (self._lines, line_load_forces_and_tangents, (on_lines,), self._load_stiffness[1]),
        ):
            if elements.count:
                f, k = kernel(elements.corners(x), *loads)
                external = external + elements.generalised(f)
                data = data - stiffness @ k.reshape(-1)
        if self._links is not None:
            factors, rho = self._links.factors(rotations)
            nnz = len(self._empty.indices)
            data = self._links.stiffness(self._reduced, nnz, data, internal - external, factors, rho)
            internal, external = (self._links.forces(f, factors) for f in (internal, external))
        return internal - external, self.matrix(data), self.unknowns.norm(external)

    def matrix(self, data):
        """Sparse (q,q) matrix on the fixed pattern, which all these matrices share."""
        matrix = copy.copy(self._empty)  # a constructor would check the pattern again, for longer than it takes to fill
        matrix.data = data
        return matrix

    def energy(self, x, chains):
        """Strain energy J of all chains at node positions x (n,3)."""
        return sum(chain_energy(x, c) for c in chains)
