"""Springs, tension-only lines and ropes over pulleys: one kernel, because all are a chain of nodes with one tension."""

from dataclasses import dataclass, field

import numpy as np

# Radius of the knob at a sheave and at the ends of a rope, relative to the rest length of the rope: some millimetres on
# a kite. A leg shorter than that has the length (l^2 / knob + knob) / 2, so that the force of a sheave that has run
# onto the end of its rope grows from zero over the knob. With l itself it would have no limit there, and a jammed rope
# no equilibrium. Longer legs do not notice.
KNOB = 1e-3
# An element this little short of taut, relative to its rest length, is stiff for Newton's method: a row of them that
# hangs loose by rounding alone would fall into pieces else, and find together by one element in each iteration.
TOUCH = 1e-10


@dataclass(frozen=True, eq=False)
class Chains:
    """Elements of m nodes each: m = 2 springs and lines, m = 3 a rope through one sheave, m = k + 2 through k sheaves.

    `nodes` (e, m) indices along the rope, `l0` (e,) rest length m (0 is allowed for springs), `k` (e,) stiffness N/m of
    the whole element, `two_way` (e,) bool: also takes compression, `names` (e,). In motion `c` (e,) N s/m is the
    viscous damping of the rate of its length (None: none), over that of its rest length, `l0_rate` (e,) m/s (None: 0).
    """

    nodes: np.ndarray
    l0: np.ndarray
    k: np.ndarray
    two_way: np.ndarray
    names: tuple[str, ...] = field(default=())
    c: np.ndarray | None = None
    l0_rate: np.ndarray | None = None

    def __post_init__(self):
        if self.c is not None and np.any(self.c < 0.0):
            worst = int(np.argmin(self.c))
            name = self.names[worst] if self.names else f"number {worst}"
            raise ValueError(f"the damping of element {name} is {self.c[worst]:g} N s/m; it must not be negative.")

    def select(self, rows):
        """The chosen elements."""
        names = tuple(np.array(self.names, dtype=object)[rows]) if self.names else ()
        moving = (None if a is None else a[rows] for a in (self.c, self.l0_rate))
        return Chains(self.nodes[rows], self.l0[rows], self.k[rows], self.two_way[rows], names, *moving)


def _legs(x, chains):
    """Directions (e, m-1, 3), lengths (e, m-1) m of all legs, what d was divided by, and which legs end in a knob."""
    d = np.diff(x[chains.nodes], axis=1)
    l = np.sqrt(np.einsum("eik,eik->ei", d, d))
    knob = KNOB * chains.l0[:, None] if chains.nodes.shape[1] > 2 else 0.0
    jammed = l < knob
    safe = np.maximum(l, knob)
    safe = np.where(safe > 0.0, safe, 1.0)
    return d / safe[..., None], np.where(jammed, 0.5 * (l * l / safe + safe), l), safe, jammed


def stretched(x, chains):
    """Unit legs, lengths m, divisors m and knobs as in `_legs`, and the stretch m (e,) of every element."""
    u, l, safe, jammed = _legs(x, chains)
    return u, l, safe, jammed, l.sum(axis=1) - chains.l0


def tensions(x, chains):
    """Tension N (e,) of every element at node positions x (n,3): k <sum of leg lengths - l0>.

    The bracket is the positive part unless the element is two-way (PSM thesis eq. 4.3, engineering strain). A
    frictionless rope has the same tension in all of its legs.
    """
    _, l, _, _ = _legs(x, chains)
    return _tension(l, chains)[0]


def _tension(l, chains):
    stretch = l.sum(axis=1) - chains.l0
    tension = np.where(chains.two_way | (stretch > 0.0), chains.k * stretch, 0.0)
    return tension, chains.two_way | (stretch > -TOUCH * chains.l0)


def chain_energy(x, chains, weight=None):
    """Strain energy J of all elements, sum of k <stretch>^2 / 2, each counted `weight` (e,) times."""
    _, l, _, _ = _legs(x, chains)
    t, _ = _tension(l, chains)
    energy = 0.5 * t * t / chains.k
    return float(np.sum(energy if weight is None else weight * energy))


def length_gradient(u):
    """Derivative of the element lengths with respect to their nodes, (e, m, 3), from unit legs u (e, m-1, 3)."""
    g = np.zeros((u.shape[0], u.shape[1] + 1, 3))
    g[:, :-1] -= u
    g[:, 1:] += u
    return g


def chain_forces(x, chains):
    """Internal forces N (e, m, 3) on the nodes of every element: the gradient of its strain energy, T dL/dx."""
    u, l, _, _ = _legs(x, chains)
    t, _ = _tension(l, chains)
    return t[:, None, None] * length_gradient(u)


def chain_forces_and_tangents(x, chains):
    """Internal forces (e, m, 3) N and consistent tangents (e, 3m, 3m) N/m.

    K = k g g^T + T d2L/dx2, with g = dL/dx over all nodes of the rope, which couples its legs, and per leg
    d2l/dx2 = (I - u u^T) / l, or I / knob where the leg is shorter than the knob. A slack element gives zeros; a spring
    of zero rest length gives k I even at zero length.
    """
    u, l, safe, jammed = _legs(x, chains)
    t, active = _tension(l, chains)
    per_length = np.where(l > 0.0, t[:, None] / safe, 0.0)
    g = length_gradient(u)
    if g.shape[1] == 2:
        return t[:, None, None] * g, _spring_tangents(u[:, 0], l[:, 0], chains.k * active, per_length[:, 0], chains)
    e, m, _ = g.shape
    flat = g.reshape(e, 3 * m)
    tangent = (chains.k * active)[:, None, None] * (flat[:, :, None] * flat[:, None, :])
    along = np.where(jammed, 0.0, 1.0)[..., None, None] * (u[..., :, None] * u[..., None, :])
    geometric = per_length[..., None, None] * (np.eye(3) - along)  # (e, m-1, 3, 3)
    blocks = tangent.reshape(e, m, 3, m, 3)
    for i in range(m - 1):
        blocks[:, i, :, i, :] += geometric[:, i]
        blocks[:, i + 1, :, i + 1, :] += geometric[:, i]
        blocks[:, i, :, i + 1, :] -= geometric[:, i]
        blocks[:, i + 1, :, i, :] -= geometric[:, i]
    return t[:, None, None] * g, tangent


def _spring_tangents(u, l, k, per_length, chains):
    """Tangents (e,6,6) N/m of elements with two nodes: blocks k u u^T + T/l (I - u u^T), negative between the nodes."""
    per_length = np.where((l == 0.0) & (chains.l0 == 0.0), chains.k, per_length)
    block = (k - per_length)[:, None, None] * (u[:, :, None] * u[:, None, :])
    block += per_length[:, None, None] * np.eye(3)
    tangent = np.empty((len(u), 2, 3, 2, 3))
    tangent[:, 0, :, 0] = tangent[:, 1, :, 1] = block
    tangent[:, 0, :, 1] = tangent[:, 1, :, 0] = -block
    return tangent.reshape(len(u), 6, 6)
