"""Springs, tension-only lines and ropes over pulleys: one kernel, because all are a chain of nodes with one tension.

They may be damped (Kelvin-Voigt): a viscous resistance to the rate of their lengths.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from interface.validity import Criterion

from .contract import ElementGroup

# Radius of the knob at a sheave and at the ends of a rope, relative to the rest length of the rope: some millimetres on
# a kite. A leg shorter than that has the length (l^2 / knob + knob) / 2, so that the force of a sheave that has run
# onto the end of its rope grows from zero over the knob. With l itself it would have no limit there, and a jammed rope
# no equilibrium. Longer legs do not notice.
KNOB = 1e-3
# An element this little short of taut, relative to its rest length, is stiff for Newton's method: a row of them that
# hangs loose by rounding alone would fall into pieces else, and find together by one element in each iteration.
TOUCH = 1e-10
# Part of its length and coordinates by which rounding alone may make an element slack or taut: four units of doubles.
ROUNDED = 4.0 * float(np.finfo(float).eps)
# The damping of an element that cannot push grows from zero over this stretch, relative to its rest length: the force
# of a line that becomes taut at speed would jump else, and an implicit step over the jump would have no solution.
ONSET = 1e-5

# Strain above which the stiffness of lines is not that of lines any more, and that of the nets of an inflatable wing
# not that of the fabric that they stand for.
LINE_STRAIN = Criterion(
    "largest_line_strain",
    "line strain",
    0.01,
    "LEI thesis, section 5.2.1: lines stretch by less than 1 %",
    percent=True,
)
CANOPY_STRAIN = Criterion(
    "largest_canopy_strain", "canopy strain", 0.01, "LEI thesis, section 7.1: every element stretches by less than 1 %",
    percent=True,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Chains(ElementGroup):
    """Elements of m nodes each: m = 2 springs and lines, m = 3 a rope through one sheave, m = k + 2 through k sheaves.

    `nodes` (e, m) indices along the rope, `l0` (e,) rest length m (0 is allowed for springs), `k` (e,) stiffness N/m of
    the whole element, `two_way` (e,) bool: also takes compression, `names` (e,). In motion `c` (e,) N s/m is the
    viscous damping of the rate of its length (None: none), over that of its rest length, `l0_rate` (e,) m/s (None: 0).
    `canopy` (e,) bool are elements that stand for fabric (None: none); the others that cannot push are lines.
    """

    nodes: np.ndarray
    l0: np.ndarray
    k: np.ndarray
    two_way: np.ndarray
    names: tuple[str, ...] = field(default=())
    c: np.ndarray | None = None
    l0_rate: np.ndarray | None = None
    canopy: np.ndarray | None = None

    def __post_init__(self):
        if self.c is not None and np.any(self.c < 0.0):
            worst = int(np.argmin(self.c))
            raise ValueError(
                f"the damping of element {self.label(worst)} is {self.c[worst]:g} N s/m; it must not be negative."
            )

    def properties(self):
        """See ElementGroup."""
        return {"rest length": self.l0, "stiffness": self.k, "two-way": self.two_way}

    def forces(self, at):
        """See ElementGroup."""
        return chain_forces(at.x, self)

    def forces_and_tangents(self, at):
        """See ElementGroup."""
        return chain_forces_and_tangents(at.x, self)

    def energy(self, at):
        """See ElementGroup."""
        return chain_energy(at.x, self)

    @property
    def damped(self):
        """See ElementGroup."""
        return self.c is not None

    def damping_forces(self, at):
        """See ElementGroup."""
        return damping_forces(at.x, at.v, self)

    def damping_forces_and_tangents(self, at, isotropic=False):
        """See ElementGroup."""
        return damping_forces_and_tangents(at.x, at.v, self, isotropic)

    def damper_work(self, after, begin, end):
        """See ElementGroup."""
        return damper_work(begin, end, self, after)

    def changing_work(self, after, begin, end):
        """See ElementGroup; exact where stretch, rest length and stiffness go linearly from one end to the other."""
        return reeling_work(begin.x, end.x, self, after)

    @property
    def criteria(self):
        """See ElementGroup."""
        kinds = (LINE_STRAIN, self._lines), (CANOPY_STRAIN, self.canopy)
        return tuple(criterion for criterion, rows in kinds if rows is not None and rows.any())

    def measured(self, at):
        """See ElementGroup: `length` m over all legs of a rope, as its law has it, `tension` N, and `strain`, the
        elongation over the rest length, negative where slack, 0 without rest length.
        """
        length = _legs(at.x, self)[1].sum(axis=1)
        some = self.l0 > 0.0
        strain = np.where(some, length / np.where(some, self.l0, 1.0) - 1.0, 0.0)
        return {"length": length, "tension": _tension(length, self)[0], "strain": strain}

    def judged(self, measured):
        """See ElementGroup."""
        strain = measured["strain"]
        found = {LINE_STRAIN.name: np.where(self._lines, strain, 0.0)}
        return found if self.canopy is None else found | {CANOPY_STRAIN.name: np.where(self.canopy, strain, 0.0)}

    @property
    def _lines(self):
        return ~self.two_way if self.canopy is None else ~(self.two_way | self.canopy)

    def undamped(self):
        """See ElementGroup."""
        return replace(self, c=None)

    def never_slack(self):
        """See ElementGroup."""
        return self if self.two_way.all() else replace(self, two_way=np.ones_like(self.two_way))

    def stiffness(self, at):
        """See ElementGroup."""
        return self.k

    def rounding(self, at, reach):
        """See ElementGroup: k along the element and T / l across it, on both of its ends, times the larger of the rest
        length and of the coordinates of the nodes, which long structures of short elements reach far with; nothing
        where it is slack.
        """
        length = _legs(at.x, self)[1].sum(axis=1)
        far = np.maximum(self.l0, np.abs(at.x[self.nodes]).max(axis=(1, 2), initial=0.0))
        active = self.two_way | (length - self.l0 > -ROUNDED * far)
        across = np.clip(1.0 - self.l0 / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        return np.where(active, np.sqrt(2.0) * self.k * (1.0 + across) * far, 0.0)

    def only_pulling(self):
        """See ElementGroup."""
        return self

    def softenable(self):
        """See ElementGroup. Springs that may push keep their stiffness, which keeps them from buckling."""
        return float(np.max(self.k * self.l0, where=~self.two_way, initial=0.0))

    def softened(self, load):
        """See ElementGroup: k' = k P / (P + k l0)."""
        return replace(self, k=np.where(self.two_way, self.k, self.k * load / (load + self.k * self.l0)))


def _legs(x, chains):
    """Directions (e, m-1, 3), lengths (e, m-1) m of all legs, what d was divided by, and which legs end in a knob."""
    d = np.diff(x[chains.nodes], axis=1)
    l = np.sqrt(np.einsum("eik,eik->ei", d, d))
    knob = KNOB * chains.l0[:, None] if chains.nodes.shape[1] > 2 else 0.0
    jammed = l < knob
    safe = np.maximum(l, knob)
    safe = np.where(safe > 0.0, safe, 1.0)
    return d / safe[..., None], np.where(jammed, 0.5 * (l * l / safe + safe), l), safe, jammed


def _stretched(x, chains):
    """Unit legs, lengths m, divisors m and knobs as in `_legs`, and the stretch m (e,) of every element."""
    u, l, safe, jammed = _legs(x, chains)
    return u, l, safe, jammed, l.sum(axis=1) - chains.l0


def tensions(x, chains):
    """Tension N (e,) of every element at node positions x (n,3): k <sum of leg lengths - l0>.

    The bracket is the positive part unless the element is two-way (PSM thesis eq. 4.3, engineering strain). A
    frictionless rope has the same tension in all of its legs.
    """
    _, l, _, _ = _legs(x, chains)
    return _tension(l.sum(axis=1), chains)[0]


def _tension(length, chains):
    stretch = length - chains.l0
    tension = np.where(chains.two_way | (stretch > 0.0), chains.k * stretch, 0.0)
    return tension, chains.two_way | (stretch > -TOUCH * chains.l0)


def chain_energy(x, chains):
    """Strain energy J of all elements, sum of k <stretch>^2 / 2."""
    _, l, _, _ = _legs(x, chains)
    t, _ = _tension(l.sum(axis=1), chains)
    return float(np.sum(0.5 * t * t / chains.k))


def _length_gradient(u):
    """Derivative of the element lengths with respect to their nodes, (e, m, 3), from unit legs u (e, m-1, 3)."""
    g = np.zeros((u.shape[0], u.shape[1] + 1, 3))
    g[:, :-1] -= u
    g[:, 1:] += u
    return g


def chain_forces(x, chains):
    """Internal forces N (e, m, 3) on the nodes of every element: the gradient of its strain energy, T dL/dx."""
    u, l, _, _ = _legs(x, chains)
    t, _ = _tension(l.sum(axis=1), chains)
    return t[:, None, None] * _length_gradient(u)


def chain_forces_and_tangents(x, chains):
    """Internal forces (e, m, 3) N and consistent tangents (e, 3m, 3m) N/m.

    K = k g g^T + T d2L/dx2, with g = dL/dx over all nodes of the rope, which couples its legs, and per leg
    d2l/dx2 = (I - u u^T) / l, or I / knob where the leg is shorter than the knob. A slack element gives zeros; a spring
    of zero rest length gives k I even at zero length.
    """
    u, l, safe, jammed = _legs(x, chains)
    t, active = _tension(l.sum(axis=1), chains)
    per_length = np.where(l > 0.0, t[:, None] / safe, 0.0)
    g = _length_gradient(u)
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


def _rates(x, v, chains):
    """Everything about lengths and their rates that forces and tangents need."""
    u, length, safe, jammed, stretch = _stretched(x, chains)
    dv = np.diff(v[chains.nodes], axis=1)
    rate = np.einsum("eik,eik->e", u, dv)
    if chains.l0_rate is not None:
        rate = rate - chains.l0_rate
    return u, length, safe, jammed, stretch, dv, rate


def _viscous(stretch, rate, chains):
    """Damping forces N (e,) and their derivatives by stretch N/m and rate N s/m.

    A two-way element resists with c times its rate. One that cannot push does so only while it is taut, and never to
    the point of pushing: k s + c rate >= 0.
    """
    onset = ONSET * np.where(chains.l0 > 0.0, chains.l0, 1.0)
    part = np.where(chains.two_way, 1.0, np.clip(stretch / onset, 0.0, 1.0))
    growing = ~chains.two_way & (stretch > 0.0) & (stretch < onset)
    force = chains.c * part * rate
    by_stretch = np.where(growing, chains.c * rate / onset, 0.0)
    by_rate = chains.c * part
    pushing = ~chains.two_way & (force < -chains.k * np.maximum(stretch, 0.0))
    taut = stretch > 0.0
    force = np.where(pushing, np.where(taut, -chains.k * stretch, 0.0), force)
    by_stretch = np.where(pushing, np.where(taut, -chains.k, 0.0), by_stretch)
    return force, by_stretch, np.where(pushing, 0.0, by_rate)


def damping_forces(x, v, chains):
    """Internal damping forces N (e,m,3) on the nodes of every element at positions x and velocities v (n,3).

    F = c (dL/dt - dl0/dt) dL/dx along the legs (PSM thesis eq. 4.4, for a whole rope).
    """
    u, _, _, _, stretch, _, rate = _rates(x, v, chains)
    return _viscous(stretch, rate, chains)[0][:, None, None] * _length_gradient(u)


def damper_work(begin, end, before, after):
    """Heat J of the dampers between two moving configurations, the integral of F (dL - dl0), and the part of it J that
    changes of rest length put in, of -F dl0: of the mean force while an element is taut all the way, and where it
    becomes taut or slack of the force on its taut side, over the part of the way on that side.
    """
    if before.c is None or after.c is None:
        return 0.0, 0.0
    u0, _, _, _, s0, _, rate0 = _rates(begin.x, begin.v, before)
    u1, _, _, _, s1, _, rate1 = _rates(end.x, end.v, after)
    f0, f1 = _viscous(s0, rate0, before)[0], _viscous(s1, rate1, after)[0]
    start, stop = _taut_part(s0, s1, before)
    way, dl = (end.x - begin.x)[before.nodes], after.l0 - before.l0
    longer = [np.einsum("eik,eik->e", _length_gradient(u), way) for u in (u0, u1)]
    whole = before.two_way | ((s0 > 0.0) & (s1 > 0.0))
    part = (stop - start) * np.where(s1 > 0.0, f1, f0)
    put_in = -np.where(whole, 0.5 * (f0 + f1), part) * dl
    heat = np.where(whole, 0.5 * (f0 * longer[0] + f1 * longer[1]) + put_in, part * (s1 - s0))
    return float(heat.sum()), float(put_in.sum())


def reeling_work(x0, x1, before, after):
    """Work J that changes of rest length, and of the stiffness that goes with it, put into the springs while the nodes
    go from x0 to x1 (n,3) m and the elements change from those `before` to those `after`: the integral of
    -T dl0 + s^2 dk / 2, with the stretch s that goes linearly too, over the part in which an element is taut.

    Of the strain energy at fixed nodes nothing can be asked: line that is paid out faster than it is stretched would
    have been stretched by all of it, or be slack, at places that it never was at.
    """
    s0, s1 = (_stretched(x, chains)[-1] for x, chains in ((x0, before), (x1, after)))
    dl, dk, ds = after.l0 - before.l0, after.k - before.k, s1 - s0
    begin, stop = _taut_part(s0, s1, before)

    def rate(at):
        s = s0 + at * ds
        return 0.5 * s * s * dk - (before.k + at * dk) * s * dl

    simpson = rate(begin) + 4.0 * rate(0.5 * (begin + stop)) + rate(stop)  # exact: of second degree
    return float((stop - begin) @ simpson) / 6.0


def _taut_part(s0, s1, chains):
    """Where on the way from stretch s0 to s1 (e,) m, parts of one, each element begins and ends to pull; the same where
    it does not at all.
    """
    crossing = np.divide(s0, s0 - s1, out=np.zeros_like(s0), where=(s0 > 0.0) != (s1 > 0.0))
    begin = np.where(chains.two_way | (s0 > 0.0), 0.0, crossing)
    return begin, np.where(chains.two_way | (s1 > 0.0), 1.0, crossing)


def damping_forces_and_tangents(x, v, chains, isotropic=False):
    """Forces N (e,m,3), and derivatives (e,3m,3m) by positions N/m and by velocities N s/m.

    With F = T(s, ds/dt) g, g = dL/dx and H = d2L/dx2: dF/dv = T_r g g^T, dF/dx = g (T_s g + T_r H v)^T + T H. The first
    is along the element only. `isotropic` takes c I between neighbouring nodes instead and no dF/dx, as the PSM thesis
    does (eq. 5.16).
    """
    u, length, safe, jammed, stretch, dv, rate = _rates(x, v, chains)
    force, by_stretch, by_rate = _viscous(stretch, rate, chains)
    g = _length_gradient(u)
    e, m, _ = g.shape
    if isotropic:
        legs = chains.c[:, None, None, None] * np.broadcast_to(np.eye(3), (e, m - 1, 3, 3))
        return force[:, None, None] * g, np.zeros((e, 3 * m, 3 * m)), _between(legs)
    flat = g.reshape(e, 3 * m)
    along = np.where(jammed, 0.0, 1.0)[..., None]
    turning = np.where((length > 0.0)[..., None], dv - along * np.einsum("eik,eik->ei", u, dv)[..., None] * u, 0.0)
    swing = _length_gradient(turning / safe[..., None]).reshape(e, 3 * m)  # H v
    gradient = by_stretch[:, None] * flat + by_rate[:, None] * swing
    across = np.where(length > 0.0, force[:, None] / safe, 0.0)[..., None, None]
    legs = across * (np.eye(3) - along[..., None] * (u[..., :, None] * u[..., None, :]))
    by_x = flat[:, :, None] * gradient[:, None, :] + _between(legs)
    return force[:, None, None] * g, by_x, by_rate[:, None, None] * (flat[:, :, None] * flat[:, None, :])


def _between(legs):
    """Matrices (e,3m,3m) that resist the relative displacement of neighbouring nodes with blocks (e,m-1,3,3)."""
    e, count, _, _ = legs.shape
    m = count + 1
    out = np.zeros((e, m, 3, m, 3))
    for i in range(count):
        out[:, i, :, i] += legs[:, i]
        out[:, i + 1, :, i + 1] += legs[:, i]
        out[:, i, :, i + 1] -= legs[:, i]
        out[:, i + 1, :, i] -= legs[:, i]
    return out.reshape(e, 3 * m, 3 * m)
