"""Velocity on the surface of a body: the gradient of a panel quantity along the surface, by least squares.

A panel's gradient comes from the values at the centres of the panels around it, two rings. What lies beyond an edge
counts the less the more the surface folds there, and nothing beyond a crease, so that gradients are one-sided at
creases and trailing edges and yet are continuous functions of the shape. The surface around a panel is laid out in its
tangent plane: a neighbour lies in the direction of its centre, as far off as along an arc that turns by the angle
between the two normals, which keeps coarse noses accurate. On these coordinates t a polynomial is fitted, quadratic
where the stencil determines it and linear else, weighted by 1 / |t|^2 in units of the stencil's own extent. Quadratic
fits have order 2 on smooth structured panels. Which neighbours and which polynomial are found once, on the reference
shape; weights follow the shape.

Flat triangles on a curved surface are tilted, by as much as they are large and in turn one way and the other; what is
along the surface is therefore along the mean of a triangle and the three around it, which takes most of that away.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from interface.vectors import cross

# Least ratio of extents across and along a stencil (squared) that determines a linear fit: what is below is a row of
# panels in one line, between two creases.
THIN = 1e-6
# Least eigenvalue of the scaled normal equations of a quadratic fit, over the largest.
QUADRATIC = 1e-7
# Degrees by which normals turn at an edge, and how many times more than at the next edges (a nose of few panels turns
# at all of its edges), between which an edge turns from smooth into a crease; see CREASE and CONCENTRATED of bodies.
FOLDED, ALONE = (35.0, 55.0), (3.0, 5.0)
FLAT = 1e-6  # degrees of a fold that is none
# Weight of a neighbour beyond an edge that is nearly a crease, and beyond one that has folded since; in between weights
# are in geometric progression. Fits stay determined, and hardly know of neighbours of this weight.
LEAST = 1e-3


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Panels beside panels: those of panel i are `panel[start[i]:start[i + 1]]`, across the edges `edge[...]`."""

    start: np.ndarray
    panel: np.ndarray
    edge: np.ndarray

    @classmethod
    def across(cls, count, sides, edges):
        """Of `count` panels, across some `edges` of those with two `sides` (e,2)."""
        panel = sides[edges].ravel()
        order = np.argsort(panel, kind="stable")
        start = np.concatenate([[0], np.cumsum(np.bincount(panel, minlength=count))])
        return cls(start, sides[edges][:, ::-1].ravel()[order], np.repeat(edges, 2)[order])

    def of(self, panels):
        """For each neighbour of `panels` (n,), one after the other: whose it is of these, itself and the edge to it."""
        lengths = self.start[panels + 1] - self.start[panels]
        which = np.repeat(np.arange(len(panels)), lengths)
        at = self.start[panels][which] + np.arange(len(which)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        return which, self.panel[at], self.edge[at]


@dataclass(frozen=True, eq=False)
class Folds:
    """Edges that values pass: `sides` (e,2) panels on either side, and `beside` (e,2) the edges opposite in these,
    -1 where there are none. `shut` (e,): open and trailing edges, which nothing passes.
    """

    sides: np.ndarray
    beside: np.ndarray
    shut: np.ndarray

    @classmethod
    def of(cls, body):
        """The edges of a `Body`."""
        edges, shut = np.arange(len(body.edges)), body.sides[:, 1] < 0
        shut[body.trailing_edge] = True
        own = body.of_panel[body.sides]
        slot = np.argmax(own == edges[:, None, None], axis=2)
        opposite = np.take_along_axis(own, ((slot + 2) % 4)[..., None], axis=2)[..., 0]
        return cls(body.sides, np.where((own >= 0).all(axis=2), opposite, -1), shut)

    def passing(self, normal):
        """How much (e + 1,) passes each edge where panels have the unit `normal` (m,3): 1 on a smooth surface, 0 over a
        crease. The last is of no edge: 1.
        """
        one, other = normal[self.sides[:, 0]], normal[self.sides[:, 1]]
        turn = np.degrees(2.0 * np.arctan2(np.linalg.norm(one - other, axis=1), np.linalg.norm(one + other, axis=1)))
        turn[self.shut] = 0.0
        next_to = np.append(turn, 0.0)[self.beside].min(axis=1)
        alone = turn / np.maximum(next_to, FLAT)
        folded = _rise(turn, *FOLDED) * _rise(alone, *ALONE)
        return np.append(np.where(self.shut | (folded >= 1.0), 0.0, LEAST**folded), 1.0)


@dataclass(frozen=True, eq=False)
class Paths:
    """Ways to the neighbours of panels, over one edge or two: `first` and `second` (p,) the edges, the second none
    where it is one, sorted by the neighbours that they lead to, those of `begin` (q,) on; a neighbour is at `row` and
    `place` (q,) of a table.
    """

    first: np.ndarray
    second: np.ndarray
    begin: np.ndarray
    row: np.ndarray
    place: np.ndarray

    def reach(self, passing, shape):
        """How much of each neighbour counts, a table of that `shape`: that of its best way."""
        found = np.zeros(shape)
        if len(self.begin):
            found[self.row, self.place] = np.maximum.reduceat(passing[self.first] * passing[self.second], self.begin)
        return found


@dataclass(frozen=True, eq=False)
class Stencils:
    """Panels around each of r panels: `rows` (r,) their numbers, `neighbours` (r,k) padded with the panel itself,
    `present` (r,k) bool, `quadratic` (r,) bool which polynomial is fitted, `beside` (r,3) the panels around a triangle,
    the panel itself for all others, and `across` (r,3) the edges to these, -1 for none. `folds` and `paths` say how
    much of a neighbour counts, all of it for the panels that are `short` (r,) of neighbours and have some `beyond`
    (r,k) folds.
    """

    rows: np.ndarray
    neighbours: np.ndarray
    present: np.ndarray
    quadratic: np.ndarray
    beside: np.ndarray
    across: np.ndarray
    folds: Folds
    paths: Paths
    short: np.ndarray
    beyond: np.ndarray

    @classmethod
    def of(cls, body, centre, normal, rows=None):
        """Stencils of the panels `rows` (all without) of a `Body` with `centre` (m,3) m and unit `normal` (m,3) of its
        panels in the reference shape.

        A panel whose smooth neighbours lie in one line, as on a flat tip one panel wide, gets those over creases too.
        """
        count, folds = len(centre), Folds.of(body)
        rows = np.arange(count) if rows is None else np.asarray(rows)
        passing = folds.passing(normal)
        smooth = _adjacency(body.sides[passing[:-1] > 0.0], count)
        around = smooth + smooth @ smooth
        beside, across = _beside(body, rows, passing)
        neighbours, present = _padded(around[rows], rows)
        none, no = np.zeros(len(rows), bool), Paths(*np.zeros((5, 0), int))
        found = cls(rows, neighbours, present, none, beside, across, folds, no, none, np.zeros_like(present))
        short = ~(_flatness(_tangent_coordinates(found, centre, normal)[0], present) > THIN)
        if short.any():
            crossing = _adjacency(body.sides[(passing[:-1] == 0.0) & ~folds.shut], count)
            wide = csr_array((np.ones(short.sum()), (rows[short], rows[short])), shape=(count, count))
            around = around + wide @ (crossing + crossing @ smooth)
            neighbours, present = _padded(around[rows], rows)
        open_to = Neighbours.across(count, body.sides, np.flatnonzero(passing[:-1] > 0.0))
        paths = _paths(rows, neighbours, present, open_to, len(body.edges))
        beyond = present & (paths.reach(passing, present.shape) == 0.0)
        found = replace(found, neighbours=neighbours, present=present, paths=paths, short=short, beyond=beyond)
        return replace(found, quadratic=found._determined(centre, normal))

    def _determined(self, centre, normal):
        """Whether neighbours that count as across a fold half way to a crease determine a quadratic fit, (r,)."""
        reach = self.reach(normal)
        near = reach >= np.sqrt(LEAST)
        t, _ = _scaled(_tangent_coordinates(self, centre, normal)[0], reach)
        size = np.sqrt(np.einsum("rkc,rkc->rk", t, t))
        terms = near[..., None] * _terms(t) / np.where(size > 0.0, size, 1.0)[..., None]
        values = np.linalg.eigvalsh(np.einsum("rki,rkj->rij", terms, terms))
        return (near.sum(axis=1) >= 5) & (values[:, 0] > QUADRATIC * values[:, -1])

    def reach(self, normal):
        """How much (r,k) of each neighbour counts where panels have the unit `normal` (m,3), 0 where padded."""
        found = np.maximum(self.paths.reach(self.folds.passing(normal), self.present.shape), LEAST)
        return self.present * np.where(self.short[:, None], 1.0, found)

    def normals(self, normal):
        """Unit normals (r,3) of the surface at the panels, whose own are `normal` (m,3)."""
        share = self.folds.passing(normal)[self.across].min(axis=1)
        return unit(normal[self.rows] + share[:, None] * normal[self.beside].mean(axis=1))

    def weights(self, points, normal, centre):
        """Weights (r,k,3) 1/m: the gradient along the surface at the `centre` (m,3) m of a panel is their sum with the
        differences of values at the `points` (m,3) m of its neighbours to that at its own.
        """
        t, axes = _tangent_coordinates(self, points, normal)
        reach = self.reach(normal)
        scaled, back = _scaled(t, reach)
        size = np.einsum("rkc,rkc->rk", scaled, scaled)
        w = reach / np.where(self.present, size, 1.0)
        terms = _terms(scaled)
        terms[~self.quadratic, :, 2:] = 0.0
        normal_matrix = np.einsum("rki,rkj,rk->rij", terms, terms, w)
        inverse = np.linalg.pinv(normal_matrix, rcond=THIN * QUADRATIC, hermitian=True)
        off = np.einsum("rij,rjc,rc->ri", back, axes, (centre - points)[self.rows])
        plane = np.einsum("rij,rjl,rkl,rk->rki", _slopes(off), inverse, terms, w, optimize=True)
        return np.einsum("rki,rij,rjc->rkc", plane, back, axes)

    def gradient(self, weights, values):
        """Gradient (r,3) along the surface of `values` (m,) at the centres of all panels, with the `weights` of a
        shape.
        """
        return np.einsum("rkc,rk->rc", weights, values[self.neighbours] - values[self.rows, None])


def tangential(vectors, normal):
    """The part (r,3) of vectors (r,3) along surfaces with unit `normal` (r,3)."""
    return vectors - np.einsum("rc,rc->r", vectors, normal)[:, None] * normal


def unit(vectors):
    """Vectors (...,3) divided by their length."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _beside(body, rows, passing):
    """The three panels around each of the triangles `rows` (r,3) and the edges to them; the panel itself and -1 for
    others, and where something of the `passing` (e + 1,) of an edge is missing altogether.
    """
    own, across = np.repeat(rows[:, None], 3, axis=1), np.full((len(rows), 3), -1)
    triangle = np.flatnonzero(body.panels[rows, 2] == body.panels[rows, 3])
    of = body.of_panel[rows[triangle]]
    of = of[of >= 0].reshape(-1, 3)
    full = (passing[of] > 0.0).all(axis=1)
    triangle, of = triangle[full], of[full]
    sides = body.sides[of]
    own[triangle] = np.where(sides[..., 0] == rows[triangle, None], sides[..., 1], sides[..., 0])
    across[triangle] = of
    return own, across


def _paths(rows, neighbours, present, around, none):
    """The `Paths` through the `Neighbours` `around` panels to the `neighbours` (r,k) that are `present` of the panels
    `rows` (r,); `none` is the number of no edge.
    """
    row, middle, first = around.of(rows)
    again, target, second = around.of(middle)
    row, target = np.concatenate([row, row[again]]), np.concatenate([middle, target])
    first, second = np.concatenate([first, first[again]]), np.concatenate([np.full(len(first), none), second])
    other = target != rows[row]
    row, target, first, second = row[other], target[other], first[other], second[other]
    order = np.lexsort((target, row))
    row, target = row[order], target[order]
    begin = np.flatnonzero(np.append(True, (np.diff(row) != 0) | (np.diff(target) != 0))) if len(row) else order
    to = np.argmax((neighbours[row[begin]] == target[begin, None]) & present[row[begin]], axis=1)
    return Paths(first[order], second[order], begin, row[begin], to)


def _rise(x, low, high):
    """0 up to `low`, 1 from `high` on, with no kink between (0 and 1 have no slope)."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _adjacency(pairs, count):
    i, j = np.asarray(pairs, int).reshape(-1, 2).T
    both = np.concatenate([i, j]), np.concatenate([j, i])
    return csr_array((np.ones(2 * len(i)), both), shape=(count, count))


def _padded(around, rows):
    """Columns of a CSR matrix (r,m) other than the panel of the row itself, in rising order, padded with it: (r,k) and
    which are no padding.
    """
    around = csr_array(around)
    around.sum_duplicates()
    row = np.repeat(np.arange(len(rows)), np.diff(around.indptr))
    other = around.indices != rows[row]
    row, column = row[other], around.indices[other]
    lengths = np.bincount(row, minlength=len(rows))
    k = max(1, int(lengths.max(initial=1)))
    place = np.arange(len(row)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    neighbours = np.repeat(rows[:, None], k, axis=1)
    neighbours[row, place] = column
    return neighbours, np.arange(k) < lengths[:, None]


def _tangent_coordinates(stencils, centre, normal):
    """Neighbours laid out in the tangent planes, (r,k,2) m, 0 where padded, and the axes (r,2,3) of the planes."""
    n = normal[stencils.rows]
    least = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    first = unit(tangential(least, n))
    axes = np.stack([first, cross(n, first)], axis=1)
    d = centre[stencils.neighbours] - centre[stencils.rows][:, None]
    t = np.einsum("rkc,ric->rki", d, axes)
    flat, straight = np.linalg.norm(t, axis=2), np.linalg.norm(d, axis=2)
    turn = np.arccos(np.clip(np.einsum("rkc,rc->rk", normal[stencils.neighbours], n), -1.0, 1.0))
    half = 0.5 * turn
    arc = straight / np.sinc(half / np.pi)  # |d| (turn / 2) / sin(turn / 2)
    t *= np.where(flat > 0.0, arc / np.where(flat > 0.0, flat, 1.0), 0.0)[..., None]
    if (row := np.nonzero(stencils.beyond))[0].size:
        t[row] = np.einsum("fc,fic->fi", _unfolded(d[row], n[row[0]], normal[stencils.neighbours[row]]), axes[row[0]])
    return t, axes


def _unfolded(d, normal, beyond):
    """What is at d (f,3) m from panels with unit `normal` (f,3), on panels with the unit normals `beyond` (f,3) over a
    fold, laid out in their plane (f,3) m: along the fold where it is, and across it as far off as it is.

    What is seen at a right angle has no direction of its own in the plane.
    """
    out = tangential(beyond, normal) * np.where(np.einsum("fc,fc->f", d, normal) <= 0.0, 1.0, -1.0)[:, None]
    out /= np.maximum(np.linalg.norm(out, axis=1), THIN)[:, None]
    fold = cross(normal, out)
    along = np.einsum("fc,fc->f", d, fold)
    across = np.sqrt(np.maximum(np.einsum("fc,fc->f", d, d) - along**2, 0.0))
    return along[:, None] * fold + across[:, None] * out


def _covariance(t, weight):
    total = weight.sum(axis=1)
    return np.einsum("rki,rkj,rk->rij", t, t, weight) / np.where(total > 0.0, total, 1.0)[:, None, None]


def _flatness(t, weight):
    """Least over largest eigenvalue (r,) of the covariance of the neighbours with a weight (r,k)."""
    values = np.linalg.eigvalsh(_covariance(t, weight))
    return values[:, 0] / np.where(values[:, 1] > 0.0, values[:, 1], 1.0)


def _scaled(t, weight):
    """Coordinates in units of the stencil's extent along its principal axes, of neighbours with a weight (r,k), and the
    matrices (r,2,2) that bring a gradient in them back to one in t. Extents below THIN of the other are taken as that.
    """
    values, vectors = np.linalg.eigh(_covariance(t, weight))
    extent = np.sqrt(np.maximum(values, THIN * values[:, 1:]))
    extent = np.where(extent > 0.0, extent, 1.0)
    back = (vectors / extent[:, None, :]).transpose(0, 2, 1)
    return np.einsum("rij,rkj->rki", back, t), back


def _terms(t):
    """Monomials (r,k,5) u, v, u^2, u v, v^2."""
    u, v = t[..., 0], t[..., 1]
    return np.stack([u, v, u * u, u * v, v * v], axis=-1)


def _slopes(t):
    """Derivatives (r,2,5) along u and v of the monomials of `_terms` at t (r,2)."""
    (u, v), one, zero = t.T, np.ones(len(t)), np.zeros(len(t))
    return np.stack([[one, zero, 2.0 * u, v, zero], [zero, one, zero, u, 2.0 * v]]).transpose(2, 0, 1)
