"""Velocity on the surface of a body: the gradient of a panel quantity along the surface, by least squares.

A panel's gradient comes from the values at the centres of the panels around it, two rings over smooth edges, so that
it is one-sided at trailing edges and creases. The surface around a panel is laid out in its tangent plane: a neighbour
lies in the direction of its centre, as far off as along an arc that turns by the angle between the two normals, which
keeps coarse noses accurate. On these coordinates t a polynomial is fitted, quadratic where the stencil determines it
and linear else, weighted by 1 / |t|^2 in units of the stencil's own extent. Quadratic fits have order 2 on smooth
structured panels. Which neighbours and which polynomial are found once, on the reference shape; weights follow the
shape.

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


@dataclass(frozen=True, eq=False)
class Stencils:
    """Panels around each of r panels: `rows` (r,) their numbers, `neighbours` (r,k) padded with the panel itself,
    `present` (r,k) bool, `quadratic` (r,) bool which polynomial is fitted, and `beside` (r,3) the panels around a
    triangle on a smooth surface, the panel itself for all others.
    """

    rows: np.ndarray
    neighbours: np.ndarray
    present: np.ndarray
    quadratic: np.ndarray
    beside: np.ndarray

    @classmethod
    def of(cls, body, centre, normal, rows=None):
        """Stencils of the panels `rows` (all without) of a `Body` with `centre` (m,3) m and unit `normal` (m,3) of its
        panels in the reference shape.

        A panel whose smooth neighbours lie in one line, as on a flat tip one panel wide, gets those over creases too.
        """
        count = len(centre)
        rows = np.arange(count) if rows is None else np.asarray(rows)
        smooth = body.neighbours
        first = csr_array((np.ones(len(smooth.panel)), smooth.panel, smooth.start), shape=(count, count))
        around = first + first @ first
        beside = _beside(body, rows)
        neighbours, present = _padded(around[rows], rows)
        found = cls(rows, neighbours, present, np.zeros(len(rows), bool), beside)
        short = rows[~(_flatness(_tangent_coordinates(found, centre, normal)[0], found.present) > THIN)]
        if len(short):
            crossing = _adjacency(body.sides[body.creases], count)
            wide = csr_array((np.ones(len(short)), (short, short)), shape=(count, count))
            around = around + wide @ (crossing + crossing @ first)
            neighbours, present = _padded(around[rows], rows)
            found = replace(found, neighbours=neighbours, present=present)
        return replace(found, quadratic=found._determined(centre, normal))

    def _determined(self, centre, normal):
        """Whether the neighbours determine a quadratic fit, (r,)."""
        t, _ = _scaled(_tangent_coordinates(self, centre, normal)[0], self.present)
        size = np.sqrt(np.einsum("rkc,rkc->rk", t, t))
        terms = _terms(t) / np.where(size > 0.0, size, 1.0)[..., None]
        values = np.linalg.eigvalsh(np.einsum("rki,rkj->rij", terms, terms))
        return (self.present.sum(axis=1) >= 5) & (values[:, 0] > QUADRATIC * values[:, -1])

    def normals(self, normal):
        """Unit normals (r,3) of the surface at the panels, whose own are `normal` (m,3)."""
        return unit(normal[self.rows] + normal[self.beside].mean(axis=1))

    def weights(self, points, normal, centre):
        """Weights (r,k,3) 1/m: the gradient along the surface at the `centre` (m,3) m of a panel is their sum with the
        differences of values at the `points` (m,3) m of its neighbours to that at its own.
        """
        t, axes = _tangent_coordinates(self, points, normal)
        scaled, back = _scaled(t, self.present)
        size = np.einsum("rkc,rkc->rk", scaled, scaled)
        w = self.present / np.where(self.present, size, 1.0)
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


def _beside(body, rows):
    """The three panels around each of the triangles `rows` (r,3); the panel itself for others and where it has less."""
    smooth, own = body.neighbours, np.repeat(rows[:, None], 3, axis=1)
    triangle = body.panels[rows, 2] == body.panels[rows, 3]
    full = triangle & (np.diff(smooth.start)[rows] == 3)
    own[full] = smooth.panel[smooth.start[rows[full], None] + np.arange(3)]
    return own


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
    return t * np.where(flat > 0.0, arc / np.where(flat > 0.0, flat, 1.0), 0.0)[..., None], axes


def _covariance(t, present):
    return np.einsum("rki,rkj->rij", t, t) / np.maximum(present.sum(axis=1), 1)[:, None, None]


def _flatness(t, present):
    """Least over largest eigenvalue (r,) of the covariance of the neighbours."""
    values = np.linalg.eigvalsh(_covariance(t, present))
    return values[:, 0] / np.where(values[:, 1] > 0.0, values[:, 1], 1.0)


def _scaled(t, present):
    """Coordinates in units of the stencil's extent along its principal axes, and the matrices (r,2,2) that bring a
    gradient in them back to one in t. Extents below THIN of the other are taken as that.
    """
    values, vectors = np.linalg.eigh(_covariance(t, present))
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
