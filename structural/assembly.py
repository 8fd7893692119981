"""Residual and tangent of a structure on a sparsity pattern and scatter maps that are built once."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .beams import Beams, beam_forces, beam_forces_and_tangents
from .bending import BendingSprings, bending_energy, bending_forces, bending_forces_and_tangents
from .carried import CarriedElements
from .chains import Chains, chain_energy, chain_forces, chain_forces_and_tangents
from .damping import damping_forces, damping_forces_and_tangents
from .links import RigidLinks
from .pattern import Pattern, beam_dofs, couplings, dofs, empty_matrix, pattern
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
from .wind import Wind, drag_forces, drag_forces_and_tangents


@dataclass(frozen=True, eq=False)
class Prepared:
    """The elements and loads of the part of a structure that is solved for, in the order of the scatter maps."""

    chains: Sequence[Chains]
    beams: Sequence[Beams]
    bending: Sequence[BendingSprings]
    on_panels: tuple
    on_lines: np.ndarray
    dead: np.ndarray
    skew: np.ndarray | None
    wind: Wind | None


@dataclass(frozen=True, eq=False)
class _Legs:
    nodes: np.ndarray


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
        order = elimination_order(couplings(structure, mirror), free)
        self.unknowns: Unknowns = unknowns(structure, mirror, order)
        riding = len(structure.riders) > 0
        self._wide = unknowns(structure, mirror, order, with_riders=True) if riding else self.unknowns
        self._links = RigidLinks(structure, self._wide, self.unknowns) if riding else None
        self._rows = [self._half(c, mirror) for c in structure.chains]
        self._beam_rows = [self._half(b, mirror) for b in structure.beams]
        self._bend_rows = [self._half(b, mirror) for b in structure.bending]
        self._bending = self._parts(structure.bending, self._bend_rows)
        self._exposed = self._half(_Legs(structure.exposed), mirror)
        self._legs, self._diameter = (a[self._exposed[0]] for a in (structure.exposed, structure.diameter))
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
        groups = [(dofs(c.nodes[rows]), weight) for c, (rows, weight) in zip(s.chains, self._rows, strict=True)]
        groups += [
            (beam_dofs(b.select(rows), len(s.nodes)), weight)
            for b, (rows, weight) in zip(s.beams, self._beam_rows, strict=True)
        ]
        groups += [(dofs(b.nodes[rows]), weight) for b, (rows, weight) in zip(s.bending, self._bend_rows, strict=True)]
        groups.append((dofs(s.exposed[self._exposed[0]]), self._exposed[1]))
        spins = dofs(len(s.nodes) + np.arange(len(s.frames))[:, None])  # for the skew part of applied moments
        groups.append((spins, np.ones(len(spins))))
        groups.append((dofs(np.arange(len(s.nodes))[:, None]), np.ones(len(s.nodes))))  # for masses with directions
        carried = [elements for _, elements in (self._panels, self._lines)]
        entries = [elements.stiffness_entries() for elements in carried]
        places = Pattern(n, [(u.index[d], u.sign[d], weight) for d, weight in groups], [e[:2] for e in entries])
        self._nnz = len(places.keys)
        *self._scatter_f, self._drag_f, _, _ = places.forces
        *self._scatter_k, self._drag_k, self._scatter_skew, self._node_k = places.stiffness
        self._load_stiffness = [
            elements.stiffness_map(target, position, factor, self._nnz)
            for elements, target, (_, _, position, factor) in zip(carried, places.places, entries, strict=True)
        ]
        keys, self.diagonal = places.keys, places.diagonal
        if self._links is not None:
            q = self.unknowns.count
            r, c = self._links.pattern(keys % n, keys // n)
            keys, self._reduced = pattern(np.append(r, np.arange(q)), np.append(c, np.arange(q)), q)
            self.diagonal, self._reduced = self._reduced[-q:] if q else self._reduced[:0], self._reduced[: len(r)]
            n = q
        self._empty = empty_matrix(keys, n)

    def _parts(self, groups, rows):
        return [g.select(r) if len(r) < len(g.l0) else g for g, (r, _) in zip(groups, rows, strict=True)]

    def prepare(self, chains: tuple[Chains, ...], loads: Loads, beams: tuple[Beams, ...] | None = None):
        """The elements and loads of the solved part, and the constant dead forces, for `residual` and `tangent`.

        Without `beams` those of the structure.
        """
        beams = self.structure.beams if beams is None else beams
        parts = self._parts(chains, self._rows), self._parts(beams, self._beam_rows), self._bending
        return Prepared(*parts, *self._seen(loads))

    def _seen(self, loads):
        """Loads on the panels and lines that are solved for, dead forces (w,), skew stiffness of moments, wind."""
        panels, lines = self._panels[0], self._lines[0]
        shear = None if loads.shear is None else loads.shear[panels]
        on_lines = np.zeros((len(lines), 3)) if loads.line_load is None else loads.line_load[lines]
        dead, skew = self._wide.gather(loads.dead), None
        if loads.moment is not None:
            dead = dead + self._wide.gather(np.concatenate([0.0 * loads.dead, loads.moment]))
            skew = self._scatter_skew(-0.5 * spin(loads.moment))
        return (loads.pressure[panels], shear), on_lines, dead, skew, loads.wind if len(self._legs) else None

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
        x, rotations = self.positions(q, rotations), self.start(rotations)
        internal, external = self.elastic(x, prepared, rotations), self.external(x, prepared)
        if self._links is not None:
            factors, _ = self._links.factors(rotations)
            internal, external = (self._links.forces(f, factors) for f in (internal, external))
        return internal - external, self.unknowns.norm(external)

    def elastic(self, x, prepared, rotations=None):
        """Internal forces (w,) N of all elements at rest in node positions x (n,3) m."""
        p, internal = prepared, np.zeros(self._wide.count)
        forces = [chain_forces(x, part) for part in p.chains] + [beam_forces(x, rotations, part) for part in p.beams]
        forces += [bending_forces(x, part) for part in p.bending]
        for values, scatter in zip(forces, self._scatter_f, strict=True):
            internal += scatter(values)
        return internal

    def damping(self, x, v, prepared):
        """Internal forces (w,) N of the dampers alone at node positions x m and velocities v m/s, (n,3) each."""
        internal = np.zeros(self._wide.count)
        for part, scatter in zip(prepared.chains, self._scatter_f, strict=False):
            if part.c is not None:
                internal += scatter(damping_forces(x, v, part))
        return internal

    def external(self, x, prepared, v=None):
        """External forces (w,) N at node positions x (n,3) m, and velocities v (n,3) m/s, which drag depends on."""
        dead = prepared.dead
        for (_, elements), kernel, loads in (
            (self._panels, surface_forces, prepared.on_panels),
            (self._lines, line_load_forces, (prepared.on_lines,)),
        ):
            if elements.count:
                dead = dead + elements.generalised(kernel(elements.corners(x), *loads))
        if prepared.wind is not None:
            dead = dead + self._drag_f(drag_forces(*self._blown(x, v), prepared.wind))
        return dead

    def _blown(self, x, v):
        """Ends (k,2,3) m, their velocities (k,2,3) m/s, diameters (k,) m of the exposed legs that are solved for."""
        ends = x[self._legs]
        return ends, np.zeros_like(ends) if v is None else v[self._legs], self._diameter

    def load_forces(self, x, loads, rotations=None):
        """Generalised forces (q,) N of the loads alone at node positions x (n,3) m: linear in the loads."""
        external = self.external(x, Prepared((), (), (), *self._seen(loads)))
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
        x, rotations = self.positions(q, rotations), self.start(rotations)
        internal, external, data, _ = self._evaluated(x, rotations, prepared)
        if self._links is not None:
            factors, rho = self._links.factors(rotations)
            nnz = len(self._empty.indices)
            data = self._links.stiffness(self._reduced, nnz, data, internal - external, factors, rho)
            internal, external = (self._links.forces(f, factors) for f in (internal, external))
        return internal - external, self.matrix(data), self.unknowns.norm(external)

    def moving_residual_and_tangents(self, x, v, prepared, isotropic=False):
        """Residual (q,) N with dampers and drag at node positions x m and velocities v m/s, (n,3) each; the data of its
        derivatives by positions N/m and by velocities N s/m, to be filled in by `matrix`; the norm of external forces.

        For structures without frames. `isotropic` see `damping_forces_and_tangents`.
        """
        internal, external, data, rates = self._evaluated(x, None, prepared, v)
        for part, sf, sk in zip(prepared.chains, self._scatter_f, self._scatter_k, strict=False):
            if part.c is not None:
                f, by_x, by_v = damping_forces_and_tangents(x, v, part, isotropic)
                internal += sf(f)
                data = data + sk(by_x)
                rates = sk(by_v) if rates is None else rates + sk(by_v)
        return internal - external, data, rates, self.unknowns.norm(external)

    def _evaluated(self, x, rotations, prepared, v=None):
        """Internal and external forces (w,), data of the tangent by positions; by velocities if they count, else None.

        With velocities v (n,3) drag counts them; dampers are not in it.
        """
        p, external, rates = prepared, prepared.dead, None
        internal = np.zeros(self._wide.count)
        data = np.zeros(self._nnz) if p.skew is None else p.skew
        both = [chain_forces_and_tangents(x, part) for part in p.chains]
        both += [beam_forces_and_tangents(x, rotations, part) for part in p.beams]
        both += [bending_forces_and_tangents(x, part) for part in p.bending]
        for (f, k), sf, sk in zip(both, self._scatter_f, self._scatter_k, strict=True):
            internal += sf(f)
            data = data + sk(k)
        for (_, elements), kernel, loads, stiffness in (
            (self._panels, surface_forces_and_tangents, p.on_panels, self._load_stiffness[0]),
            (self._lines, line_load_forces_and_tangents, (p.on_lines,), self._load_stiffness[1]),
        ):
            if elements.count:
                f, k = kernel(elements.corners(x), *loads)
                external = external + elements.generalised(f)
                data = data - stiffness @ k.reshape(-1)
        if p.wind is not None:
            f, by_x, by_v = drag_forces_and_tangents(*self._blown(x, v), p.wind)
            external = external + self._drag_f(f)
            data = data - self._drag_k(by_x)
            rates = -self._drag_k(by_v) if v is not None else None
        return internal, external, data, rates

    def node_blocks(self, blocks):
        """Data of the matrix (q,q) with a block (n,3,3) on every node, to be filled in by `matrix`; no rigid links."""
        return self._node_k(blocks)

    def matrix(self, data):
        """Sparse (q,q) matrix on the fixed pattern, which all these matrices share."""
        matrix = copy.copy(self._empty)  # a constructor would check the pattern again, for longer than it takes to fill
        matrix.data = data
        return matrix

    def energy(self, x, chains):
        """Strain energy J of all chains and bending springs at node positions x (n,3)."""
        return sum(chain_energy(x, c) for c in chains) + sum(bending_energy(x, b) for b in self.structure.bending)
