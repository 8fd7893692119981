"""Shapes of lines, ropes and springs by an interior-point method, for those where Newton's method crawls from kink to
kink: the start from which it ends what is left.

Under dead loads f the shape of tension-only members minimises a convex energy, which can be written without kinks,

    minimise sum k s^2 / 2 - f.x    where the legs of each member have sum l = l0 + s, and |d| <= l for each leg d of x.

The last are second-order cones; the multipliers (T, -y) of a leg are its tension and its force, and lie in the cone
too: |y| <= T. A primal-dual path-following method with the scaling of Nesterov and Todd (1997) and Mehrotra's predictor
and corrector (as in Andersen, Roos and Terlaky 2003) solves that in some twenty to fifty factorisations from anywhere,
whatever lengths, loads and ratios of stiffness: these stand in it as flexibilities 1 / k. All matrices are on the
pattern of the structure's tangent.

Springs that may push take part as if they could not: the shape is a start, and what it is the start of has them whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from structural.assembly import Assembly
from structural.elements import ElementGroup
from structural.elements.chains import Chains
from structural.model import Loads

from . import Singular
from .linear import factorised

# Factorisations at most; the part of the way to the boundary of the cones that a step goes; below which part steps lead
# nowhere any more, by rounding; and the mean complementarity at which it is done, relative to load times size.
MOST, BOUNDARY, SHORTEST, DONE = 80, 0.99, 1e-5, 1e-13
# Tensions at the start are the largest load, at least this part of the largest k l0; lengths have this part of the size
# to spare.
PULL, SPARE = 1e-9, 0.1
# Signs of the scalar and of the vector part of (l; d) in the product of the cone.
SIGNS = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class GivenForces(ElementGroup):
    """Elements between `nodes` (e,m) whose internal forces `force` (e,m,3) N and tangents (e,3m,3m) N/m are given."""

    nodes: np.ndarray
    force: np.ndarray
    tangent: np.ndarray

    def forces(self, at):
        """See ElementGroup."""
        return self.force

    def forces_and_tangents(self, at):
        """See ElementGroup."""
        return self.force, self.tangent


def _inner(a, b):
    """Sums of products over the last axis."""
    return np.einsum("...i,...i->...", a, b)


def _depth(a):
    """l^2 - |d|^2 of vectors (...,4), without the cancellation of squares."""
    size = np.sqrt(_inner(a[..., 1:], a[..., 1:]))
    return (a[..., 0] + size) * (a[..., 0] - size)


def _product(a, b):
    """Jordan product (a.b; a0 b1 + b0 a1) of vectors (...,4)."""
    out = a[..., :1] * b + b[..., :1] * a
    out[..., 0] = _inner(a, b)
    return out


def _divided(a, b):
    """The u (...,4) whose Jordan product with a is b."""
    first = _inner(SIGNS * a, b) / _depth(a)
    rest = (b[..., 1:] - first[..., None] * a[..., 1:]) / a[..., :1]
    return np.concatenate([first[..., None], rest], axis=-1)


def _room(a, da):
    """Largest t, 1 at most, up to which all of a + t da (...,4) lie in the cone."""
    square, half, depth = _depth(da), _inner(SIGNS * a, da), _depth(a)
    root = np.sqrt(np.maximum(half * half - square * depth, 0.0))
    out = np.full(half.shape, np.inf)
    inward = half > 0.0
    np.divide(depth, root - half, out=out, where=~inward & (root > half))
    np.divide(-half - root, square, out=out, where=inward & (square < 0.0))
    out[~inward & (half * half < square * depth)] = np.inf
    return float(min(1.0, out.min(initial=1.0)))


class _Pulling:
    """Members that pull: s = (l; d) and z = (T, -y) (e,j,4) of their legs, and the tensions T (e,)."""

    def __init__(self, members, x, pull, spare):
        self.nodes, self._l0, self._give = members.nodes, members.l0, 1.0 / members.k
        self._tension = np.full(len(members), pull)
        d = np.diff(x[self.nodes], axis=1)
        own = (self._l0 + self._give * self._tension) / d.shape[1]
        longer = np.maximum(np.sqrt(_inner(d, d)) + spare, own[:, None])
        self.s = np.concatenate([longer[..., None], d], axis=2)
        self.z = np.zeros_like(self.s)
        self.z[..., 0] = pull
        self.count = longer.size

    def scale(self):
        """Take the scaling W z = W^-1 s of Nesterov and Todd, and the stiffness of the legs in it."""
        depth_s, depth_z = _depth(self.s), _depth(self.z)
        a, b = self.s / np.sqrt(depth_s)[..., None], self.z / np.sqrt(depth_z)[..., None]
        w = (a + SIGNS * b) / np.sqrt(2.0 + 2.0 * _inner(a, b))[..., None]
        self._eta = ((depth_s / depth_z) ** 0.25)[..., None]
        root = w.copy()
        root[..., 0] += 1.0
        self._root = root / np.sqrt(2.0 * root[..., :1])
        w = SIGNS * w
        square = (2.0 * w[..., :, None] * w[..., None, :] - np.diag(SIGNS)) / (self._eta**2)[..., None]
        self._k00 = square[..., 0, 0]
        self._along = square[..., 0, 1:] / self._k00[..., None]
        self._across = square[..., 1:, 1:] - square[..., 0, 1:, None] * self._along[..., None, :]
        self._stiffness = 1.0 / (self._give + (1.0 / self._k00).sum(axis=1))
        self._point = self._scaled(self.z)
        k = self._stiffness[:, None, None, None, None] * (
            self._along[:, :, :, None, None] * self._along[:, None, None, :, :]
        )
        for j in range(k.shape[1]):
            k[:, j, :, j] += self._across[:, j]
        self._tangent = _between_nodes(k)

    def _scaled(self, a):
        return self._eta * (2.0 * self._root * _inner(self._root, a)[..., None] - SIGNS * a)

    def _scaled_back(self, a):
        root = SIGNS * self._root
        return (2.0 * root * _inner(root, a)[..., None] - SIGNS * a) / self._eta

    def forces(self, target=0.0, step=None):
        """Internal forces (e,m,3) N and tangents (e,3m,3m) for one linear solve, which is to make every s.z zero, or
        the `target` J with what the `step` to zero left out.
        """
        missing = -_product(self._point, self._point)
        if step is not None:
            missing -= _product(self._scaled_back(step[0]), self._scaled(step[1]))
            missing[..., 0] += target
        self._rho = self._scaled_back(_divided(self._point, missing))
        misfit = self.s[..., 0].sum(axis=1) - self._l0 - self._give * self._tension
        self._offset = self._stiffness * ((self._rho[..., 0] / self._k00).sum(axis=1) + misfit)
        y = self.z[..., 1:] + self._rho[..., 1:] + self._along * (self._offset[:, None] - self._rho[..., 0])[..., None]
        return _on_nodes(-y), self._tangent

    def step(self, dx):
        """Changes of s, z and T with displacements (n,3) m of the nodes."""
        dd = np.diff(dx[self.nodes], axis=1)
        dt = self._offset - self._stiffness * _inner(self._along, dd).sum(axis=1)
        left = self._rho[..., 0] - dt[:, None]
        ds = np.concatenate([(left / self._k00 - _inner(self._along, dd))[..., None], dd], axis=2)
        dy = self._rho[..., 1:] - self._along * left[..., None] - np.einsum("ejab,ejb->eja", self._across, dd)
        return ds, np.concatenate([np.broadcast_to(dt[:, None, None], (*left.shape, 1)), dy], axis=2), dt

    def room(self, step):
        """Part of a step that stays in the cones, 1 at most."""
        return min(_room(self.s, step[0]), _room(self.z, step[1]))

    def gap(self, step=None, part=0.0):
        """Sum of s.z, J; after a part of a step if one is given."""
        if step is None:
            return float(np.sum(self.s * self.z))
        return float(np.sum((self.s + part * step[0]) * (self.z + part * step[1])))

    def move(self, step, part):
        """Go a part of a step; whether that is still inside to rounding."""
        self.s, self.z = self.s + part * step[0], self.z + part * step[1]
        self._tension = self._tension + part * step[2]
        return bool(np.all(_depth(self.s) > 0.0) and np.all(_depth(self.z) > 0.0))


def _on_nodes(legs):
    """Forces (e,m,3) N on nodes from those (e,m-1,3) in legs."""
    out = np.zeros((legs.shape[0], legs.shape[1] + 1, 3))
    out[:, :-1] -= legs
    out[:, 1:] += legs
    return out


def _between_nodes(k):
    """Matrices (e,3m,3m) by the positions of nodes from those (e,m-1,3,m-1,3) by legs."""
    rows = np.zeros((k.shape[0], k.shape[1] + 1, *k.shape[2:]))
    rows[:, :-1] -= k
    rows[:, 1:] += k
    out = np.zeros((*rows.shape[:3], rows.shape[1], 3))
    out[:, :, :, :-1] -= rows
    out[:, :, :, 1:] += rows
    return out.reshape(len(k), 3 * rows.shape[1], 3 * rows.shape[1])


class ConvexShape:
    """The shape `x` (n,3) m of least energy of `members`, groups of chains that only pull, under loads, sought from
    node positions x; and how many `iterations`, one factorisation each, it took.

    It has the accuracy that rounding leaves to the path: some 1e-8 of the size of the structure. Loads that follow the
    shape are taken as they are in each iteration. Where the tangent is singular, nothing moves.
    """

    def __init__(self, assembly: Assembly, loads: Loads, x: np.ndarray, members: Sequence[Chains]):
        self._assembly, self._loads = assembly, loads
        self._q = assembly.unknowns.restrict(x)
        self.x = assembly.positions(self._q)
        self.iterations = 0
        load = float(np.abs(assembly.prepare(loads, members).dead).max(initial=0.0))
        pull = max(load, PULL * max((float(np.max(group.k * group.l0, initial=0.0)) for group in members), default=0.0))
        size = float(np.ptp(self.x, axis=0).max(initial=0.0))
        self._parts = [_Pulling(group, self.x, pull, SPARE * size) for group in members]
        self._count = sum(part.count for part in self._parts)
        with np.errstate(all="ignore"):
            while self.iterations < MOST and self._mean() > DONE * pull * size and self._step():
                pass

    def _mean(self):
        """Mean of s.z of all legs, J; 0 without any."""
        return sum(part.gap() for part in self._parts) / max(self._count, 1)

    def _prepared(self, forces):
        """Elements and loads, the elements with the forces and tangents that a linear solve is to have."""
        groups = [GivenForces(part.nodes, *given) for part, given in zip(self._parts, forces, strict=True)]
        return self._assembly.prepare(self._loads, groups)

    def _step(self):
        """One step of predictor and corrector; False where it leads nowhere, and then nothing has moved."""
        mean = self._mean()
        for part in self._parts:
            part.scale()
        r, k, _ = self._assembly.residual_and_tangent(self._q, self._prepared([p.forces() for p in self._parts]))
        try:
            factors = factorised(k) if np.all(np.isfinite(k.data)) else None
        except Singular:
            factors = None
        if factors is None:
            return False
        self.iterations += 1
        steps = self._steps(factors.solve(-r))
        room = self._room(steps)
        left = sum(part.gap(step, room) for part, step in zip(self._parts, steps, strict=True)) / self._count
        target = mean * min(1.0, max(left / mean, 0.0)) ** 3
        forces = [part.forces(target, step) for part, step in zip(self._parts, steps, strict=True)]
        dq = factors.solve(-self._assembly.residual(self._q, self._prepared(forces))[0])
        steps = self._steps(dq)
        room = min(1.0, BOUNDARY * self._room(steps))
        if not (room > SHORTEST and np.all(np.isfinite(dq))):
            return False
        inside = [part.move(step, room) for part, step in zip(self._parts, steps, strict=True)]
        self._q = self._q + room * dq
        self.x = self._assembly.positions(self._q)
        return all(inside)

    def _steps(self, dq):
        dx = self._assembly.displacements(dq)
        return [part.step(dx) for part in self._parts]

    def _room(self, steps):
        return min(part.room(step) for part, step in zip(self._parts, steps, strict=True))
