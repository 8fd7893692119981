"""Doublet strengths of a body in a stream: the dense system of the internal Dirichlet condition and its solution.

With sources s = -n.V the perturbation potential inside the body is zero where

    C mu + W K mu = -B s + W k,

C, B the potentials of the body's doublets and sources at the panels' centres, W those of the wake strips, K mu the
difference of the doublets of the two panels at a trailing edge (Morino and Kuo 1974). The wake carries the jump of the
whole potential, of which k = V.(r_u - r_l), with the centres of the two panels, is the part of the stream.

C is kept in float64 and its factors in float32, as preconditioner of GMRES on the float64 operator; W is kept apart and
B is not kept, but what it makes of a uniform stream along each axis. C does not change with a rigid motion, so that a
body that moves rigidly is solved in the position that it was first met in.
"""

import os
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from interface import StepFailed

from .bodies import Body
from .collocation import collocation_points
from .influence import PanelGeometry, influence, memory_needed, source_potential
from .velocities import unit
from .wake import Wake, straight_wake

# Residual over that of no doublets. Far below what the mesh leaves (1e-3) and what differences between coupling
# iterations need (1e-8), far above rounding (1e-13 with 20 000 panels).
TOLERANCE = 1e-10
# Of the extent of a body: how far its nodes may be from a rigid motion of those that its matrix was made for. That is
# what rounding leaves; the answer is off by as much over the size of a panel.
RIGID = 1e-12
# GMRES iterations that cost as much as new factors do, as measured from 600 to 10 000 panels (18 to 70), and those that
# a solve with new ones needs. Factors are made anew when the old ones have cost as many more.
WORTH, WITH_NEW = 40, 2
MOST = 60  # with new factors


@dataclass(frozen=True, eq=False)
class SolverState:
    """What a solve leaves to the next: `doublets` (m,) m^2/s, a first guess; the `nodes` (n,3) m that the columns of
    the body were made for; the `factored` nodes (n,3) m and `direction` (3,) of the wake of the factors; and the
    iterations `spent` with these beyond what new ones need. It names what is kept beside it, so that it can be made
    again where it is not there.
    """

    doublets: np.ndarray
    nodes: np.ndarray
    factored: np.ndarray
    direction: np.ndarray
    spent: int


@dataclass(frozen=True, eq=False)
class Solution:
    """`doublets` (m,) m^2/s of the panels, `jumps` (s,) m^2/s of the wake strips, GMRES `iterations`, the relative
    `residual`, and whether the system was `factored` anew.
    """

    doublets: np.ndarray
    jumps: np.ndarray
    iterations: int
    residual: float
    factored: bool


@dataclass(frozen=True, eq=False)
class _Columns:
    """Of a body on `nodes` (n,3) m: its `geometry`, collocation `points` (m,3) m, the doublet `matrix` (m,m), and the
    potentials `streams` (m,3) of the sources that a unit stream along each axis needs.
    """

    nodes: np.ndarray
    geometry: PanelGeometry
    points: np.ndarray
    matrix: np.ndarray
    streams: np.ndarray


@dataclass(frozen=True, eq=False)
class _Factors:
    """Float32 factors of the transposed system on `nodes` (n,3) m with a straight wake along `direction` (3,)."""

    nodes: np.ndarray
    direction: np.ndarray
    lu: np.ndarray
    pivots: np.ndarray

    def __call__(self, residual):
        """The residual (m,) divided by the system, to single precision."""
        return lapack.sgetrs(self.lu, self.pivots, residual.astype(np.float32), trans=1)[0].astype(float)


class PanelSolver:
    """The doublets of a `body` (whole, or half with its image in y = 0) for its shapes and streams.

    It keeps matrix and factors of what it solved last; a state says which it needs, and gives the same numbers to the
    bit whether they are still there or not. A half that was taken from the body `whole`, its panels `rows` (m,) of
    that, has the collocation points of the whole.
    """

    def __init__(self, body: Body, whole: Body | None = None, rows=None):
        self.body, self._whole, self._rows = body, whole, rows
        self._upper, self._lower = body.trailing[:, 0], body.trailing[:, 1]
        self._used = np.unique(body.panels)
        self._columns: _Columns | None = None
        self._factors: _Factors | None = None
        self._matrix: np.ndarray | None = None

    def solve(self, nodes, onset, direction, state=None, wake=None):
        """The `Solution` on `nodes` (n,3) m in the stream `onset`, (3,) m/s or (m,3) at each panel, with the wake along
        the unit vector `direction` (3,), straight or this `wake`, and the `SolverState` it leaves.

        StepFailed in one sentence where there is no solution.
        """
        motion = None if state is None else rigid_motion(state.nodes, nodes, self._used, self.body.symmetric)
        placed = nodes if motion is None else state.nodes
        if motion is not None and not motion.none:
            onset, direction = onset @ motion.turn, unit(direction @ motion.turn)
            wake = None if wake is None else Wake(motion.back(wake.sides), direction)
        old = state is not None and state.spent < WORTH
        key = (state.factored, state.direction) if old else (placed, direction)
        factors = self._factored(*key)
        columns = self._columned(placed)
        wake = straight_wake(self.body, placed, direction) if wake is None else wake
        system = self._system(columns, wake, onset)
        right = system.wake @ system.stream - self._sources(columns, onset)
        start = np.zeros(len(right)) if state is None else state.doublets
        found = gmres(system, factors, right, start, TOLERANCE, WORTH if old else MOST)
        spent, fresh = state.spent + max(found.iterations - WITH_NEW, 0) if old else 0, not old
        if old and not found.converged:
            key, fresh = (placed, direction), True
            factors = self._factored(*key)
            again = gmres(system, factors, right, found.x, TOLERANCE, MOST)
            found, spent = replace(again, iterations=found.iterations + again.iterations), 0
        if not found.converged:
            raise StepFailed(
                f"the strengths of the panels were not found in {found.iterations} GMRES iterations: the residual is "
                f"{found.residual:.2g} of that without doublets; the body is degenerate."
            )
        solution = Solution(found.x, system.jumps(found.x), found.iterations, found.residual, fresh)
        return solution, SolverState(found.x, placed, *key, spent)

    def _factored(self, nodes, direction):
        """Factors on nodes and wake direction, those that are there if they are of these."""
        kept = self._factors
        if kept is not None and np.array_equal(kept.nodes, nodes) and np.array_equal(kept.direction, direction):
            return kept
        self._factors = kept = None  # free them before the next ones are made
        columns = self._columned(nodes)
        lu = columns.matrix.astype(np.float32)
        wake = straight_wake(self.body, nodes, direction).potentials(columns.points, self.body.symmetric)
        for strip, (upper, lower) in enumerate(self.body.trailing[:, :2]):
            lu[:, upper] += wake[:, strip]
            lu[:, lower] -= wake[:, strip]
        factors, pivots, fault = lapack.sgetrf(lu.T, overwrite_a=True)
        if fault != 0:
            raise StepFailed("the equations of the panels are singular; the body is degenerate.")
        self._factors = _Factors(nodes, direction, factors, pivots)
        return self._factors

    def _columned(self, nodes):
        """Columns of the body on nodes, those that are there if they are of these."""
        kept = self._columns
        if kept is not None and np.array_equal(kept.nodes, nodes):
            return kept
        self._columns = None
        geometry, points = PanelGeometry.of(nodes, self.body.panels), self._points(nodes)
        matrix, streams = self._buffer(), np.zeros_like(points)
        for mirrored in (False, True) if self.body.symmetric else (False,):
            _, found = influence(geometry, points, -geometry.normal, mirrored=mirrored, out=matrix)
            streams += found
        np.fill_diagonal(matrix, 0.0)
        np.fill_diagonal(matrix, 1.0 - matrix.sum(axis=1))  # doublets of strength 1 all over are 1 inside
        self._columns = _Columns(nodes, geometry, points, matrix, streams)
        return self._columns

    def _points(self, nodes):
        """Collocation points (m,3) m on nodes."""
        return (
            collocation_points(self.body, nodes)
            if self._whole is None
            else collocation_points(self._whole, nodes)[self._rows]
        )

    def _buffer(self):
        """Zeros (m,m), in the same memory at every call."""
        count = len(self.body.panels)
        if self._matrix is None:
            check_memory(count)
            self._matrix = np.zeros((count, count))
        else:
            self._matrix.fill(0.0)
        return self._matrix

    def _system(self, columns, wake, onset):
        centre, upper, lower = columns.points, self._upper, self._lower
        at_edge = onset if onset.ndim == 1 else 0.5 * (onset[upper] + onset[lower])
        stream = np.einsum("...c,...c->...", centre[upper] - centre[lower], at_edge)
        return System(columns.matrix, wake.potentials(centre, self.body.symmetric), upper, lower, stream)

    def _sources(self, columns, onset):
        """Potential (m,) m^2/s at the panels by the sources that the stream needs."""
        if onset.ndim == 1:
            return columns.streams @ onset
        strengths = -np.einsum("mc,mc->m", columns.geometry.normal, onset)
        images = (False, True) if self.body.symmetric else (False,)
        at = columns.geometry, columns.points, strengths
        return np.sum([source_potential(*at, mirrored=mirrored) for mirrored in images], axis=0)


@dataclass(frozen=True, eq=False)
class System:
    """The operator C + W K: the doublet `matrix` (m,m), potentials `wake` (m,s) of the strips that leave between the
    panels `upper` and `lower` (s,), and the part `stream` (s,) m^2/s of the free stream in their jumps.
    """

    matrix: np.ndarray
    wake: np.ndarray
    upper: np.ndarray
    lower: np.ndarray
    stream: np.ndarray

    def __call__(self, doublets):
        """Potential (m,) m^2/s inside the panels by doublets and the wake that they leave."""
        return self.matrix @ doublets + self.wake @ (doublets[self.upper] - doublets[self.lower])

    def jumps(self, doublets):
        """Strengths (s,) m^2/s of the wake strips."""
        return doublets[self.upper] - doublets[self.lower] - self.stream


@dataclass(frozen=True, eq=False)
class Found:
    """What `gmres` found: `x`, the `iterations` it took, the relative `residual`, and whether it `converged`."""

    x: np.ndarray
    iterations: int
    residual: float
    converged: bool


def gmres(operator, preconditioner, right, start, tolerance, most):
    """x with |right - operator(x)| <= tolerance |right|, from `start`, in at most `most` iterations.

    Saad and Schultz (1986), preconditioned from the right so that the residual is that of the equations, without
    restarts; the basis is made orthogonal twice. Where rounding keeps the true residual above the tolerance it starts
    again from there.
    """
    size = np.linalg.norm(right)
    if size == 0.0:
        return Found(np.zeros_like(right), 0, 0.0, True)
    x, iterations, limit = np.array(start), 0, tolerance * size
    while True:
        residual = right - operator(x)
        left = np.linalg.norm(residual)
        if left <= limit or iterations >= most or not np.isfinite(left):
            return Found(x, iterations, float(left / size), bool(left <= limit))
        step, count = _cycle(operator, preconditioner, residual, left, limit, most - iterations)
        x, iterations = x + step, iterations + count


def _cycle(operator, preconditioner, residual, left, limit, most):
    """Change of x that takes a residual of the size `left` to `limit`, and the iterations it took."""
    basis, along = [residual / left], []
    h = np.zeros((most + 1, most))
    for k in range(most):
        along.append(preconditioner(basis[k]))
        new = operator(along[k])
        for _ in range(2):
            for j, v in enumerate(basis):
                part = v @ new
                h[j, k] += part
                new = new - part * v
        h[k + 1, k] = np.linalg.norm(new)
        right = np.zeros(k + 2)
        right[0] = left
        y = np.linalg.lstsq(h[: k + 2, : k + 1], right, rcond=None)[0]
        if (
            np.linalg.norm(right - h[: k + 2, : k + 1] @ y) <= 0.5 * limit
            or h[k + 1, k] <= 1e-14 * np.abs(h[: k + 1, k]).max()
        ):
            break
        basis.append(new / h[k + 1, k])
    return np.einsum("k,km->m", y, np.array(along)), k + 1


@dataclass(frozen=True, eq=False)
class Motion:
    """x -> `turn` (x - `start`) + `end`, a rotation (3,3) about points (3,) m; `none`: not moved at all."""

    turn: np.ndarray
    start: np.ndarray
    end: np.ndarray
    none: bool = False

    def back(self, points):
        """Where moved points (...,3) m were."""
        return (points - self.end) @ self.turn + self.start


def rigid_motion(reference, nodes, used, upright):
    """The `Motion` that takes `reference` (n,3) m to `nodes` (n,3) m, of those that are `used`; None where they have
    not moved rigidly. `upright` asks for one that leaves y alone.
    """
    if np.array_equal(reference, nodes):
        return Motion(np.eye(3), np.zeros(3), np.zeros(3), none=True)
    a, b = reference[used], nodes[used]
    start, end = a.mean(axis=0), b.mean(axis=0)
    a, b = a - start, b - end
    h = a.T @ b
    if upright:
        angle = np.arctan2(h[2, 0] - h[0, 2], h[0, 0] + h[2, 2])
        c, s = np.cos(angle), np.sin(angle)
        turn, sideways = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]), abs(end[1] - start[1])
    else:
        u, _, vt = np.linalg.svd(h)
        turn, sideways = (vt.T * [1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ u.T, 0.0
    off = max(np.abs(b - a @ turn.T).max(), sideways)
    return Motion(turn, start, end) if off <= RIGID * np.ptp(a, axis=0).max() else None


def check_memory(panels):
    """StepFailed where a system of so many panels does not fit into the memory that is free."""
    needed, free = memory_needed(panels), free_memory()
    if free is not None and needed > free:
        raise StepFailed(
            f"{panels} panels need {needed / 1e9:.3g} GB of memory and {free / 1e9:.3g} GB are free; take fewer panels "
            "or a symmetric wing, of which one half is solved."
        )


def free_memory():
    """Bytes of memory that can be had, None where that is not known."""
    try:
        with open("/proc/meminfo", encoding="ascii") as table:
            rows = dict(line.split(":", 1) for line in table)
        return 1024 * int(rows["MemAvailable"].split()[0])
    except (OSError, KeyError, ValueError):
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None
