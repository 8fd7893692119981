"""Co-rotational Timoshenko beams with finite rotations: natural deformations, nodal forces and consistent tangents.

A beam between two nodes has the chord c of length l and, at each end, a triad (t, n, b) that turns with the node and
points along the beam in the reference configuration. Its six natural deformations do not change in a rigid motion:

    u = l - l0,   theta_n = g c.b,   theta_b = -g c.n at either end,   phi = twist of one triad against the other,

with g = angle / sin(angle) of the angle between c and t, so that (theta_n, theta_b) is the rotation vector from the
chord to the tangent in the section's own axes, exact for any angle below pi, and phi the angle that remains after t of
the first end is carried to t of the second along the shortest way. A section law (`sections`) gives the forces that
are conjugate to them. Nothing here has a singularity in the rotation of the nodes themselves, however large.

Co-rotational in the sense of Rankin and Nour-Omid (1988) and Battini and Pacoste (2002); written in the invariants of
chord and triads, the element needs no co-rotated frame.
"""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from interface.vectors import cross, spin

from .contract import ElementGroup, translations

# Cosine above which g is summed as a series in 1 - cos, where the closed form loses digits.
SERIES_ABOVE = 0.9
_TERMS = np.cumprod(np.concatenate([[1.0], [(k + 1.0) / (2.0 * k + 3.0) for k in range(24)]]))


@dataclass(frozen=True, eq=False)
class Beams(ElementGroup):
    """Elements between two nodes that have rotations.

    `nodes` (e,2) and `rotations` (e,2) are the nodes and nodal rotations of both ends, `axes` (e,3,3) reference triads
    as columns (t, n, b), `l0` (e,) m, `section` with `select` and `response` (see `sections`), `names` (e,).
    """

    nodes: np.ndarray
    rotations: np.ndarray
    axes: np.ndarray
    l0: np.ndarray
    section: Any
    names: tuple[str, ...] = field(default=())
    counted: ClassVar[str] = "beam"

    def dofs(self, node_count):
        """Dofs (e,12): position and spin of either end."""
        first, second = node_count + self.rotations[:, 0], node_count + self.rotations[:, 1]
        return translations(np.stack([self.nodes[:, 0], first, self.nodes[:, 1], second], axis=1))

    def properties(self):
        """See ElementGroup. What a section has beside its stiffness follows from radius and pressure."""
        return {
            "length": self.l0,
            "axial stiffness": self.section.EA,
            "bending stiffness": self.section.initial_bending,
        }

    def forces(self, at):
        """See ElementGroup."""
        return beam_forces(at.x, at.rotations, self)

    def forces_and_tangents(self, at):
        """See ElementGroup."""
        return beam_forces_and_tangents(at.x, at.rotations, self)

    @property
    def criteria(self):
        """See ElementGroup: those of the section."""
        return self.section.criteria

    def measured(self, at):
        """See ElementGroup: by name what the section is judged by."""
        if not self.criteria:
            return {}
        natural = natural_deformations(at.x, at.rotations, self)
        return self.section.judged(self.section.response(natural, self.l0)[0], natural, self.l0)

    def judged(self, measured):
        """See ElementGroup."""
        return measured

    def stiffness(self, at):
        """None that counts: shifted by that along their axes, slow modes of bending would look stiff."""
        return np.zeros(len(self))

    def rounding(self, at, reach):
        """EA and 12 EI / l0^2 of bending; beams may be much shorter than their coordinates."""
        return (self.section.EA + 12.0 * self.section.initial_bending / self.l0**2) * np.maximum(1.0, reach / self.l0)


def reference_axes(nodes, ends, across=None):
    """Triads (e,3,3) with columns t along the elements `ends` (e,2) of `nodes` (n,3), n next to `across` (3,), and b.

    Without `across` the coordinate axis that is furthest from t is taken: any will do for a tube.
    """
    d = nodes[ends[:, 1]] - nodes[ends[:, 0]]
    t = d / np.linalg.norm(d, axis=1)[:, None]
    near = np.eye(3)[np.argmin(np.abs(t), axis=1)] if across is None else np.broadcast_to(across, t.shape)
    n = near - np.einsum("ek,ek->e", near, t)[:, None] * t
    n = n / np.linalg.norm(n, axis=1)[:, None]
    return np.stack([t, n, cross(t, n)], axis=2)


def _stretch(s):
    """g(s) = arccos(s) / sqrt(1 - s^2) and its first two derivatives; beyond a right angle and more nothing ends, but
    at s = -1 the tangent points backwards and g is infinite.
    """
    s = np.clip(s, -1.0 + 1e-12, 1.0)
    e = 1.0 - s
    near = s > SERIES_ABOVE
    far = np.where(near, 0.0, s)
    sine2 = 1.0 - far * far
    g = np.arccos(far) / np.sqrt(sine2)
    g1 = (far * g - 1.0) / sine2
    g2 = (g + 3.0 * far * g1) / sine2
    if near.any():
        k = np.arange(len(_TERMS))
        value = np.polynomial.polynomial.polyval(e, _TERMS)
        slope = -np.polynomial.polynomial.polyval(e, (k * _TERMS)[1:])
        curve = np.polynomial.polynomial.polyval(e, (k * (k - 1) * _TERMS)[2:])
        g, g1, g2 = np.where(near, value, g), np.where(near, slope, g1), np.where(near, curve, g2)
    return g, g1, g2


@dataclass(frozen=True, eq=False)
class _Geometry:
    """Chord and end triads of all elements in their present shape."""

    length: np.ndarray  # (e,)
    chord: np.ndarray  # (e,3)
    triads: np.ndarray  # (e,2,3,3), columns t, n, b
    along: np.ndarray  # (e,2) chord . t
    g: tuple[np.ndarray, np.ndarray, np.ndarray]  # each (e,2)

    @classmethod
    def of(cls, x, rotations, beams):
        """From positions x (n,3) and rotations (s,3,3)."""
        d = x[beams.nodes[:, 1]] - x[beams.nodes[:, 0]]
        length = np.sqrt(np.einsum("ek,ek->e", d, d))
        chord = d / np.where(length > 0.0, length, 1.0)[:, None]
        triads = rotations[beams.rotations] @ beams.axes[:, None]
        along = np.einsum("ek,eik->ei", chord, triads[..., 0])
        return cls(length, chord, triads, along, _stretch(along))

    def natural(self, l0):
        """Natural deformations (e,6): u, theta_n1, theta_b1, theta_n2, theta_b2, phi."""
        cn, cb = (np.einsum("ek,eik->ei", self.chord, self.triads[..., k]) for k in (1, 2))
        g = self.g[0]
        (n1, b1), (n2, b2) = ((self.triads[:, i, :, 1], self.triads[:, i, :, 2]) for i in (0, 1))
        dot = lambda a, b: np.einsum("ek,ek->e", a, b)  # noqa: E731
        phi = np.arctan2(dot(b1, n2) - dot(n1, b2), dot(n1, n2) + dot(b1, b2))
        theta = [g[:, 0] * cb[:, 0], -g[:, 0] * cn[:, 0], g[:, 1] * cb[:, 1], -g[:, 1] * cn[:, 1]]
        return np.stack([self.length - l0, *theta, phi], axis=1)


def natural_deformations(x, rotations, beams):
    """Elongation m and rotations rad (e,6) of all elements: u, theta_n1, theta_b1, theta_n2, theta_b2, phi."""
    return _Geometry.of(x, rotations, beams).natural(beams.l0)


def section_forces(x, rotations, beams):
    """Axial force N, end moments N m (n, b at both ends) and torque N m of all elements, (e,6).

    The end moments turn the nodes: in the beam the bending moment goes from -m_1 at the first end to m_2.
    """
    return beams.section.response(natural_deformations(x, rotations, beams), beams.l0)[0]


def _gradients(geo):
    """Derivatives (e,6,12) of the natural deformations with respect to (x_1, spin_1, x_2, spin_2), and mean t (e,3)."""
    e = len(geo.length)
    b = np.zeros((e, 6, 4, 3))
    b[:, 0, 0], b[:, 0, 2] = -geo.chord, geo.chord
    g, g1, _ = geo.g
    for i in (0, 1):
        t, n, bb = (geo.triads[:, i, :, k] for k in (0, 1, 2))
        for row, a in ((1 + 2 * i, bb), (2 + 2 * i, -n)):
            r = np.einsum("ek,ek->e", geo.chord, a)
            h = g[:, i, None] * a + (g1[:, i] * r)[:, None] * t
            across = (h - np.einsum("ek,ek->e", h, geo.chord)[:, None] * geo.chord) / geo.length[:, None]
            b[:, row, 0], b[:, row, 2] = -across, across
            b[:, row, 1 + 2 * i] = cross(h, geo.chord)
    t1, t2 = geo.triads[:, 0, :, 0], geo.triads[:, 1, :, 0]
    mean = (t1 + t2) / (1.0 + np.einsum("ek,ek->e", t1, t2))[:, None]
    b[:, 5, 1], b[:, 5, 3] = -mean, mean
    return b.reshape(e, 6, 12), mean


def beam_forces(x, rotations, beams):
    """Internal forces N and moments N m (e,12) on (x_1, spin_1, x_2, spin_2) of every element."""
    geo = _Geometry.of(x, rotations, beams)
    force, _ = beams.section.response(geo.natural(beams.l0), beams.l0)
    return np.einsum("ead,ea->ed", _gradients(geo)[0], force)


def beam_forces_and_tangents(x, rotations, beams):
    """`beam_forces`, and the tangents (e,12,12): the second derivative of the strain energy along rotations about fixed
    axes, symmetric where the section law has an energy.

    The derivative of the moments with respect to the spins has a skew part besides, half the spin of the moment on
    each node. It cancels over the elements of a node in equilibrium without applied moments, and the assembly adds it
    where there are such.
    """
    geo = _Geometry.of(x, rotations, beams)
    force, stiffness = beams.section.response(geo.natural(beams.l0), beams.l0)
    b, mean = _gradients(geo)
    blocks = np.zeros((len(b), 4, 3, 4, 3))
    _add_axial(blocks, geo, force[:, 0])
    for i in (0, 1):
        _add_bending(blocks, geo, i, force[:, 1 + 2 * i], force[:, 2 + 2 * i])
    _add_twist(blocks, geo, mean, force[:, 5])
    geometric = blocks.reshape(-1, 12, 12)
    k = b.transpose(0, 2, 1) @ stiffness @ b + 0.5 * (geometric + geometric.transpose(0, 2, 1))
    return np.einsum("ead,ea->ed", b, force), k


def _outer(a, b):
    return a[:, :, None] * b[:, None, :]


def _chord_blocks(blocks, block):
    """Add the (d, d) derivative (e,3,3), d = x_2 - x_1, to the position blocks."""
    blocks[:, 0, :, 0] += block
    blocks[:, 2, :, 2] += block
    blocks[:, 0, :, 2] -= block
    blocks[:, 2, :, 0] -= block


def _add_axial(blocks, geo, axial):
    project = np.eye(3) - _outer(geo.chord, geo.chord)
    _chord_blocks(blocks, (axial / geo.length)[:, None, None] * project)


def _add_bending(blocks, geo, i, m_n, m_b):
    """Second derivative of g(c.t) c.A, A = m_n b - m_b n, at fixed moments."""
    c, l = geo.chord, geo.length[:, None, None]
    t = geo.triads[:, i, :, 0]
    a = m_n[:, None] * geo.triads[:, i, :, 2] - m_b[:, None] * geo.triads[:, i, :, 1]
    g, g1, g2 = (v[:, i, None] for v in geo.g)
    r = np.einsum("ek,ek->e", c, a)[:, None]
    h = g * a + g1 * r * t
    hcc = g1[..., None] * (_outer(a, t) + _outer(t, a)) + (g2 * r)[..., None] * _outer(t, t)
    project = np.eye(3) - _outer(c, c)
    hc = np.einsum("ek,ek->e", h, c)[:, None, None]
    ph = np.einsum("eij,ej->ei", project, h)
    second = project @ hcc @ project - _outer(ph, c) - _outer(c, ph) - hc * project
    _chord_blocks(blocks, second / (l * l))
    c_spin, a_spin, t_spin = spin(c), spin(a), spin(t)
    mixed = (spin(h) - c_spin @ hcc) @ project / l  # rows spin, columns d
    w = 1 + 2 * i
    blocks[:, w, :, 2] += mixed
    blocks[:, w, :, 0] -= mixed
    blocks[:, 2, :, w] += mixed.transpose(0, 2, 1)
    blocks[:, 0, :, w] -= mixed.transpose(0, 2, 1)
    a_c, t_c = cross(a, c), cross(t, c)
    dh = -g[..., None] * a_spin - (g1 * r)[..., None] * t_spin
    dh += g1[..., None] * (_outer(t, a_c) + _outer(a, t_c)) + (g2 * r)[..., None] * _outer(t, t_c)
    blocks[:, w, :, w] -= c_spin @ dh


def _add_twist(blocks, geo, mean, torque):
    t1, t2 = geo.triads[:, 0, :, 0], geo.triads[:, 1, :, 0]
    weight = torque / (1.0 + np.einsum("ek,ek->e", t1, t2))
    turn = cross(t1, t2)
    by_first = -weight[:, None, None] * (spin(t1) + _outer(mean, turn))
    by_second = -weight[:, None, None] * (spin(t2) - _outer(mean, turn))
    blocks[:, 3, :, 1] += by_first
    blocks[:, 3, :, 3] += by_second
    blocks[:, 1, :, 1] -= by_first
    blocks[:, 1, :, 3] -= by_second
