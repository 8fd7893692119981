"""Residual and tangent of a structure on a sparsity pattern and scatter maps that are built once.

It knows no family of elements and no kind of load, only what `elements.ElementGroup` and `loads.LoadGroup` promise.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from interface.mirror import mirror_permutation, mirror_rows, unique_half
from interface.vectors import spin, turned

from .dofs import RigidLinks, Unknowns, rotation_images, unknowns
from .elements import Configuration, ElementGroup, translations
from .loads import LoadGroup
from .loads.surface import SurfaceElements
from .model import Loads, Structure
from .solve.linear import elimination_order


@dataclass(frozen=True, eq=False)
class Prepared:
    """The elements and loads of the part of a structure that is solved for, in the order of the scatter maps.

    `groups` of elements, `loads` of every load group (None: nothing acts there), `dead` generalised forces, `skew`
    stiffness of moments, if any.
    """

    groups: Sequence[ElementGroup]
    loads: Sequence[Any]
    dead: np.ndarray
    skew: np.ndarray | None


@dataclass(frozen=True, eq=False)
class _Elements:
    """A group of elements as the assembly has it: which rows are solved for, how often each counts, where values go."""

    rows: np.ndarray
    weight: np.ndarray
    dofs: np.ndarray
    forces: "Scatter"
    stiffness: "Scatter"

    def part(self, group):
        """The elements that are solved for."""
        return group.select(self.rows) if len(self.rows) < len(group) else group


@dataclass(frozen=True, eq=False)
class _LoadedElements:
    """A load group as the assembly has it: which `rows` of the `whole` are solved for, and these as a `group`."""

    rows: np.ndarray
    whole: int
    group: LoadGroup

    def part(self, load):
        """The values on the elements that are solved for."""
        return load.select(self.rows) if load is not None and len(self.rows) < self.whole else load

    def points(self, x):
        """Values (e,m,3) at the corners of values x (n,3) at the nodes."""
        raise NotImplementedError

    def generalised(self, forces):
        """Generalised forces (w,) of forces (e,m,3) N on the corners."""
        raise NotImplementedError

    def data(self, tangents):
        """Data of the structure's tangent from those of the elements (e,3m,3m)."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class _OnNodes(_LoadedElements):
    """A load group between structural nodes: values go by scatter maps."""

    forces: "Scatter"
    stiffness: "Scatter"

    def points(self, x):
        """See _LoadedElements."""
        return x[self.group.nodes]

    def generalised(self, forces):
        """See _LoadedElements."""
        return self.forces(forces)

    def data(self, tangents):
        """See _LoadedElements."""
        return self.stiffness(tangents)


@dataclass(frozen=True, eq=False)
class _OnSurface(_LoadedElements):
    """A load group on a surface that follows structural nodes: values go by sparse maps."""

    surface: SurfaceElements
    stiffness: sp.csr_array

    def points(self, x):
        """See _LoadedElements."""
        return self.surface.corners(x)

    def generalised(self, forces):
        """See _LoadedElements."""
        return self.surface.generalised(forces)

    def data(self, tangents):
        """See _LoadedElements."""
        return self.stiffness @ tangents.reshape(-1)


class Assembly:
    """Residual (q,) and tangent (q,q) of a structure in its unknowns, for changing positions, rotations and loads.

    Forces N and moments N m, per m and per rad. The unknowns are q for positions; nodal rotations (r,3,3), None where
    there are none, go beside them, and `moved` makes both from a step.
    """

    def __init__(self, structure: Structure, mirror: np.ndarray | None = None):
        self.structure, self._mirror = structure, mirror
        free = np.array(~structure.fixed.all(axis=1))
        free[structure.dependent_nodes] = False
        free[structure.rotation_nodes[~structure.fixed_rotations.all(axis=1)]] = True
        order = elimination_order(_couplings(structure, mirror), free)
        self.unknowns: Unknowns = unknowns(structure, mirror, order)
        linked = len(structure.dependent_nodes) > 0
        self._unreduced = unknowns(structure, mirror, order, with_dependents=True) if linked else self.unknowns
        self._links = RigidLinks(structure, self._unreduced, self.unknowns) if linked else None
        self._build_pattern()

    def _halved(self, group):
        """Rows of elements that are solved for, and how often each counts."""
        if self._mirror is None:
            return np.arange(len(group)), np.ones(len(group))
        images = group.images(self._mirror, rotation_images(self.structure.rotation_nodes, self._mirror))
        if np.any(images < 0):
            lone = group.label(int(np.argmax(images < 0)))
            raise ValueError(f"element {lone} has no mirror image although the structure is to be halved.")
        return unique_half(images)

    def _halved_surface(self, name, group, known):
        """As `_halved`, of a load group; `known` has the mirror images of the surfaces met so far."""
        if self._mirror is None:
            return np.arange(len(group)), np.ones(len(group))
        mirror, surface = self._mirror, id(group.weights)
        if group.weights is not None:
            if surface not in known:
                known[surface] = mirror_permutation(group.weights @ self.structure.nodes)
            mirror = known[surface]
        images = None if mirror is None else mirror_rows(group.nodes, mirror, group.canonical)
        if images is None or np.any(images < 0):
            raise ValueError(f"load group '{name}' is not mirror-symmetric although the structure is to be halved.")
        return unique_half(images)

    def _build_pattern(self):
        u, s = self._unreduced, self.structure
        images: dict[int, np.ndarray | None] = {}
        n = len(s.nodes)
        halves = [self._halved(group) for group in s.groups]
        blocks = [(g.dofs(n)[rows], weight) for g, (rows, weight) in zip(s.groups, halves, strict=True)]
        loaded: list[tuple[np.ndarray, LoadGroup, LoadGroup, SurfaceElements | None]] = []
        entries = []
        for name, group in s.load_groups.items():
            rows, weight = self._halved_surface(name, group, images)
            part = group.select(rows)
            if group.weights is None:
                blocks.append((translations(part.nodes), weight))
                loaded.append((rows, group, part, None))
            else:
                on_surface = SurfaceElements(part.nodes, weight, group.weights, u)
                entries.append(on_surface.stiffness_entries())
                loaded.append((rows, group, part, on_surface))
        spins = translations(n + np.arange(len(s.rotation_nodes))[:, None])  # for the skew part of applied moments
        blocks.append((spins, np.ones(len(spins))))
        blocks.append((translations(np.arange(n)[:, None]), np.ones(n)))  # for masses with directions
        places = Pattern(u.count, [(u.index[d], u.sign[d], weight) for d, weight in blocks], [e[:2] for e in entries])
        self._nnz = len(places.keys)
        scatter = list(zip(blocks, places.forces, places.stiffness, strict=True))
        self._elements = [
            _Elements(rows, weight, dofs, f, k)
            for (rows, weight), ((dofs, _), f, k) in zip(halves, scatter[: len(halves)], strict=True)
        ]
        self._scatter_skew, self._node_k = (k for _, _, k in scatter[-2:])
        direct, spread = iter(scatter[len(halves) : -2]), iter(zip(places.places, entries, strict=True))
        self._loaded: dict[str, _LoadedElements] = {}
        for name, (rows, group, part, surface) in zip(s.load_groups, loaded, strict=True):
            if surface is None:
                _, f, k = next(direct)
                self._loaded[name] = _OnNodes(rows, len(group), part, f, k)
            else:
                target, (_, _, position, factor) = next(spread)
                matrix = surface.stiffness_map(target, position, factor, self._nnz)
                self._loaded[name] = _OnSurface(rows, len(group), part, surface, matrix)
        self._reduce(places.keys, places.diagonal)

    def _reduce(self, keys, diagonal):
        """The pattern of the tangent, where rigid links are left out of the one that values are scattered into."""
        n = self._unreduced.count
        self.diagonal = diagonal
        if self._links is not None:
            q = self.unknowns.count
            r, c = self._links.pattern(keys % n, keys // n)
            keys, self._reduced = pattern(np.append(r, np.arange(q)), np.append(c, np.arange(q)), q)
            self.diagonal, self._reduced = self._reduced[-q:] if q else self._reduced[:0], self._reduced[: len(r)]
            n = q
        self._empty = empty_matrix(keys, n)

    def prepare(self, loads: Loads, groups: Sequence[ElementGroup] | None = None) -> Prepared:
        """The elements and loads of the solved part, and the constant dead forces, for `residual` and `tangent`.

        Without `groups` those of the structure. ValueError for loads on a group that the structure does not have.
        """
        groups = self.structure.groups if groups is None else groups
        if len(groups) != len(self._elements):
            raise ValueError(f"the structure has {len(self._elements)} groups of elements; {len(groups)} are given.")
        parts = [place.part(group) for place, group in zip(self._elements, groups, strict=True)]
        return Prepared(parts, *self._seen(loads))

    def _seen(self, loads):
        """Loads of each load group that is solved for, dead forces (w,), skew stiffness of moments."""
        for name, load in loads.on.items():
            if name not in self._loaded:
                known = ", ".join(self._loaded) or "none"
                raise ValueError(f"the structure has no load group '{name}'; it has: {known}.")
            self.structure.load_groups[name].require(load, name)
        on = [e.part(loads.on.get(name)) if len(e.rows) else None for name, e in self._loaded.items()]
        dead, skew = self._unreduced.gather(loads.dead), None
        if loads.moment is not None:
            dead = dead + self._unreduced.gather(np.concatenate([0.0 * loads.dead, loads.moment]))
            skew = self._scatter_skew(-0.5 * spin(loads.moment))
        return on, dead, skew

    def start(self, rotations=None):
        """Nodal rotations (r,3,3) to begin with: given ones, or those of the reference configuration; None without."""
        initial = self.structure.initial_rotations
        return initial if rotations is None or initial is None else rotations

    def moved(self, q, rotations, step):
        """Unknowns and rotations after a `step` (q,), m and rad."""
        return q + step, None if rotations is None else turned(rotations, self.unknowns.spins(step))

    def positions(self, q, rotations=None):
        """Node positions (n,3) m, dependent nodes and all."""
        x = self.unknowns.expand(q)
        if self._links is not None:
            self._links.place(x, self.start(rotations))
        return x

    def configuration(self, q, rotations=None):
        """The shape of the whole structure with the unknowns q."""
        return Configuration(self.positions(q, rotations), self.start(rotations))

    def residual(self, q, prepared, rotations=None):
        """Internal minus external generalised forces (q,) N at the unknowns q, and the norm of the external ones."""
        at = self.configuration(q, rotations)
        internal, external = self.elastic(at, prepared), self.external(at, prepared)
        if self._links is not None:
            factors, _ = self._links.factors(at.rotations)
            internal, external = (self._links.forces(f, factors) for f in (internal, external))
        return internal - external, self.unknowns.norm(external)

    def elastic(self, at, prepared):
        """Internal forces (w,) N of all elements at rest in a configuration."""
        internal = np.zeros(self._unreduced.count)
        for place, part in zip(self._elements, prepared.groups, strict=True):
            internal += place.forces(part.forces(at))
        return internal

    def damping(self, at, prepared):
        """Internal forces (w,) N of the dampers alone in a moving configuration."""
        internal = np.zeros(self._unreduced.count)
        for place, part in zip(self._elements, prepared.groups, strict=True):
            if part.damped:
                internal += place.forces(part.damping_forces(at))
        return internal

    def external(self, at, prepared):
        """External forces (w,) N in a configuration, which may move: drag depends on it."""
        external = prepared.dead
        for elements, load in zip(self._loaded.values(), prepared.loads, strict=True):
            if load is not None:
                moving = None if at.v is None else elements.points(at.v)
                external = external + elements.generalised(elements.group.forces(elements.points(at.x), load, moving))
        return external

    def load_forces(self, x, loads, rotations=None):
        """Generalised forces (q,) N of the loads alone at node positions x (n,3) m: linear in loads that are."""
        return self._linked(Configuration(x, self.start(rotations)), Prepared((), *self._seen(loads)))

    def external_forces(self, q, rotations, prepared):
        """Generalised external forces (q,) N at the unknowns q."""
        return self._linked(self.configuration(q, rotations), prepared)

    def _linked(self, at, prepared):
        external = self.external(at, prepared)
        if self._links is None:
            return external
        return self._links.forces(external, self._links.factors(at.rotations)[0])

    def displacements(self, step, rotations=None):
        """Displacements (n,3) m of all nodes in a small `step` (q,): the derivative of `positions`."""
        dx = self.unknowns.displacements(step)
        if self._links is not None:
            self._links.displace(dx, self.unknowns.spins(step), self.start(rotations))
        return dx

    def residual_and_tangent(self, q, prepared, rotations=None):
        """Residual (q,) N and consistent tangent (q,q) N/m, elements, links, load stiffness and all; the norm of the
        external forces.
        """
        at = self.configuration(q, rotations)
        internal, external, data, _ = self._evaluated(at, prepared)
        if self._links is not None:
            factors, rho = self._links.factors(at.rotations)
            nnz = len(self._empty.indices)
            data = self._links.stiffness(self._reduced, nnz, data, internal - external, factors, rho)
            internal, external = (self._links.forces(f, factors) for f in (internal, external))
        return internal - external, self.matrix(data), self.unknowns.norm(external)

    def moving_residual_and_tangents(self, x, v, prepared, isotropic=False):
        """Residual (q,) N with dampers and drag at node positions x m and velocities v m/s, (n,3) each; the data of its
        derivatives by positions N/m and by velocities N s/m, to be filled in by `matrix`; the norm of external forces.

        For structures without rotational dofs. `isotropic` see `ElementGroup.damping_forces_and_tangents`.
        """
        at = Configuration(x, None, v)
        internal, external, data, rates = self._evaluated(at, prepared)
        for place, part in zip(self._elements, prepared.groups, strict=True):
            if part.damped:
                f, by_x, by_v = part.damping_forces_and_tangents(at, isotropic)
                internal += place.forces(f)
                data = data + place.stiffness(by_x)
                rates = place.stiffness(by_v) if rates is None else rates + place.stiffness(by_v)
        return internal - external, data, rates, self.unknowns.norm(external)

    def _evaluated(self, at, prepared):
        """Internal and external forces (w,), data of the tangent by positions; by velocities if they count, else None.

        In a moving configuration drag counts the velocities; dampers are not in it.
        """
        external, rates = prepared.dead, None
        internal = np.zeros(self._unreduced.count)
        data = np.zeros(self._nnz) if prepared.skew is None else prepared.skew
        both = [part.forces_and_tangents(at) for part in prepared.groups]
        for (f, k), place in zip(both, self._elements, strict=True):
            internal += place.forces(f)
            data = data + place.stiffness(k)
        for elements, load in zip(self._loaded.values(), prepared.loads, strict=True):
            if load is not None:
                moving = None if at.v is None else elements.points(at.v)
                f, by_x, by_v = elements.group.forces_and_tangents(elements.points(at.x), load, moving)
                external = external + elements.generalised(f)
                data = data - elements.data(by_x)
                if by_v is not None:
                    rates = -elements.data(by_v) if rates is None else rates - elements.data(by_v)
        return internal, external, data, rates

    def smoothing(self, prepared, rotations=None):
        """Data of the matrix (q,q) N/m that smooths steps of elements that wrinkle, to be filled in by `matrix`; None
        without such elements.
        """
        parts = [(place, part.smoothing()) for place, part in zip(self._elements, prepared.groups, strict=True)]
        data = [place.stiffness(tangents) for place, tangents in parts if tangents is not None]
        if not data:
            return None
        if self._links is None:
            return sum(data)
        factors, rho = self._links.factors(self.start(rotations))
        still = np.zeros(self._unreduced.count)
        return self._links.stiffness(self._reduced, len(self._empty.indices), sum(data), still, factors, rho)

    def node_blocks(self, blocks):
        """Data of the matrix (q,q) with a block (n,3,3) on every node, to be filled in by `matrix`; no rigid links."""
        return self._node_k(blocks)

    def matrix(self, data):
        """Sparse (q,q) matrix on the fixed pattern, which all these matrices share."""
        matrix = copy.copy(self._empty)  # a constructor would check the pattern again, for longer than it takes to fill
        matrix.data = data
        return matrix

    def energy(self, at, groups):
        """Strain energy J of all `groups` in a configuration; ValueError where the forces of one have none."""
        parts = [group.energy(at) for group in groups]
        if None in parts:
            family = type(groups[parts.index(None)]).__name__
            raise ValueError(f"{family} have no energy, so there is no balance of energies with them.")
        return sum(parts)


def _couplings(structure, mirror):
    """Sparse incidences (elements, n) of the nodes that elements and load groups couple.

    The reference node stands for those that depend on it; with a `mirror` permutation a node stands for its image too.
    """
    n = len(structure.nodes)
    stands_for = np.arange(n)
    stands_for[structure.dependent_nodes] = structure.reference_nodes
    groups = [(g.nodes, None) for g in structure.groups]
    groups += [(g.nodes, g.weights) for g in structure.load_groups.values()]
    for elements, weights in groups:
        e, m = elements.shape
        columns = n if weights is None else weights.shape[0]
        entries = np.ones(e * m), (np.repeat(np.arange(e), m), elements.ravel())
        incidence = sp.csr_array(entries, shape=(e, columns))
        incidence = incidence if weights is None else sp.csr_array(incidence @ abs(sp.csr_array(weights)))
        if len(structure.dependent_nodes):
            links = sp.csr_array((np.ones(n), (np.arange(n), stands_for)), shape=(n, n))
            incidence = sp.csr_array(incidence @ links)
        yield incidence if mirror is None else incidence + incidence[:, mirror]


# Values from which they are scattered by a sparse product: the sums are the same to the last bit, the time is half.
# Below, the call takes longer than the sums.
MANY = 20_000


class Scatter:
    """Where the values of element blocks go: `target` in `data` or the residual (of `size`, where pads go to a last
    bin), with signs.
    """

    def __init__(self, target, sign, size):
        self._size = size
        self._target, self._sign, self._matrix = target, sign, None
        if len(target) >= MANY:
            columns = np.arange(len(target) + 1, dtype=np.int32)
            shape = size + 1, len(target)
            self._matrix = sp.csc_array((sign, target.astype(np.int32), columns), shape=shape)
            self._target = self._sign = None

    def __call__(self, values):
        if self._matrix is not None:
            return (self._matrix @ values.reshape(-1))[: self._size]
        return np.bincount(self._target, self._sign * values.reshape(-1), minlength=self._size + 1)[: self._size]


def pattern(rows, columns, n):
    """Keys column * n + row of the distinct entries inside (n,n), rising, and the place of every entry in them; their
    number for entries outside, which have a negative index.
    """
    inside = (rows >= 0) & (columns >= 0)
    r, c = rows[inside].astype(np.int32), columns[inside].astype(np.int32)
    found = sp.csc_array(sp.coo_array((np.ones(len(r), np.int8), (r, c)), shape=(n, n)))
    found.sort_indices()
    count = found.nnz
    keys = np.repeat(np.arange(n), np.diff(found.indptr)) * n + found.indices
    found.data = np.arange(count, dtype=np.int32)
    where = np.full(len(rows), count)
    if count:
        where[inside] = found[r, c]
    return keys, where


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
