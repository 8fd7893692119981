"""Exact potential flows, and surfaces for them: ellipsoids in a stream, Karman-Trefftz profiles."""

import numpy as np
from scipy.special import elliprd

from interface.panels import area_vectors


def outward(nodes, panels):
    """The panels of a surface that is starlike about the origin, turned so that their normals point outward."""
    inward = np.einsum("mc,mc->m", area_vectors(nodes[panels]), nodes[panels].mean(axis=1)) < 0.0
    return np.where(inward[:, None], panels[:, ::-1], panels)


def sphere(n):
    """Nodes and 6 n^2 quads on the unit sphere: a cube whose faces are divided by equal angles."""
    t = np.tan(0.25 * np.pi * np.linspace(-1.0, 1.0, n + 1))
    u, v = np.meshgrid(t, t, indexing="ij")
    one = np.ones_like(u)
    faces = ((one, u, v), (-one, u, v), (u, one, v), (u, -one, v), (u, v, one), (u, v, -one))
    points = np.concatenate([np.stack(face, axis=-1).reshape(-1, 3) for face in faces])
    points /= np.linalg.norm(points, axis=1)[:, None]
    _, first, node = np.unique(points.round(9) + 0.0, axis=0, return_index=True, return_inverse=True)
    grid = node.reshape(6, n + 1, n + 1)
    four = [grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]]
    nodes = points[first]
    return nodes, outward(nodes, np.stack(four, axis=-1).reshape(-1, 4))


def halved(panels):
    """Two triangles (2 m,4) of each quad (m,4)."""
    return np.concatenate([panels[:, [0, 1, 2, 2]], panels[:, [0, 2, 3, 3]]])


def ellipsoid_velocity(points, axes, stream):
    """Velocity (p,3) of the flow around an ellipsoid with semi-axes `axes` (3,) in a `stream` (3,), at `points` (p,3)
    on it: the part along the surface of 2 / (2 - alpha_i) V_i (Lamb 1932, section 114).
    """
    a2 = np.square(axes)
    alpha = np.array([2.0 / 3.0 * np.prod(axes) * elliprd(a2[(i + 1) % 3], a2[(i + 2) % 3], a2[i]) for i in range(3)])
    normal = points / a2
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    v = 2.0 / (2.0 - alpha) * stream
    return v - (normal @ v)[:, None] * normal


class KarmanTrefftz:
    """A profile between x = 0 and 1 and the flow around it: the image of a circle through z = b.

    `thickness` and `camber` are the distances of the centre of the circle from the origin, back and up, over b; `edge`
    is the exponent, 2 for the cusp of Joukowsky, 2 - angle / pi for a trailing edge with an angle.
    """

    def __init__(self, thickness, camber=0.0, edge=2.0):
        self._n, self._centre = edge, -thickness + 1j * camber
        self._radius = abs(1.0 - self._centre)
        self._beta = np.angle(1.0 - self._centre)
        z = self._map(self._circle(np.linspace(0.0, 2.0 * np.pi, 20001)[1:-1]))
        self._least, self._chord = z.real.min(), self._n - z.real.min()

    def _circle(self, angle):
        return self._centre + self._radius * np.exp(1j * (angle + self._beta))

    def _map(self, zeta):
        up, down = (zeta + 1.0) ** self._n, (zeta - 1.0) ** self._n
        return self._n * (up + down) / (up - down)

    def points(self, count):
        """Points (count,2), from the trailing edge over the upper side to the nose and back: equal angles of the
        circle, from the trailing edge on.
        """
        angle = 2.0 * np.pi * np.arange(count) / count
        z = np.empty(count, complex)
        z[0], z[1:] = self._n, self._map(self._circle(angle[1:]))
        z = (z - self._least) / self._chord
        return np.column_stack([z.real, z.imag])

    def pressure(self, points, alpha):
        """C_p at `points` (p,2) close to the profile at the angle `alpha` rad."""
        z = self._least + self._chord * (points @ [1.0, 1.0j])
        angle = np.linspace(0.0, 2.0 * np.pi, 40001)[1:-1]
        on = self._map(self._circle(angle))
        near = np.argmin(np.abs(z[:, None] - on), axis=1)
        zeta = self._circle(angle[near])
        from_centre = zeta - self._centre
        swirl = 2j * self._radius * np.sin(alpha - self._beta)
        w = np.exp(-1j * alpha) - self._radius**2 * np.exp(1j * alpha) / from_centre**2 + swirl / from_centre
        up, down = (zeta + 1.0) ** self._n, (zeta - 1.0) ** self._n
        slope = 4.0 * self._n**2 * (zeta**2 - 1.0) ** (self._n - 1.0) / (up - down) ** 2
        return 1.0 - np.abs(w / slope) ** 2

    def lift(self, alpha):
        """C_L at the angle `alpha` rad."""
        return 8.0 * np.pi * self._radius / self._chord * np.sin(alpha - self._beta)
