"""Faces with four corners (a triangle may repeat its last one), three, or six nodes: follower pressure and traction.

The force of a face is p a + s |a|, a its area vector: pressure pushes along the normal and follows it, traction keeps
its direction. It is shared among the corners by int N_i dA, a third each on triangles. On curved triangles of six nodes
(corners, then the middles of the sides 01, 12, 20; `curved_faces`) it is int N_i (p n + s) dA itself.
"""

from dataclasses import dataclass

import numpy as np

from interface.mirror import canonical_faces
from interface.panels import AREA, SHARE, area_vectors, corner_shares
from interface.vectors import cross, spin

from .contract import Load, LoadGroup


@dataclass(frozen=True, eq=False)
class FaceLoad(Load):
    """`pressure` (p,) Pa along the area vector of each face, `shear` (p,3) Pa in fixed directions; None: none."""

    pressure: np.ndarray
    shear: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Faces(LoadGroup):
    """Faces `nodes` (p,4), of which a triangle repeats its last corner, (p,3), or (p,6)."""

    takes = FaceLoad

    @staticmethod
    def canonical(nodes):
        """See LoadGroup."""
        return canonical_faces(nodes)

    def forces(self, points, load, velocities=None):
        """See LoadGroup."""
        return self._kernels()[0](points, load.pressure, load.shear)

    def forces_and_tangents(self, points, load, velocities=None):
        """See LoadGroup."""
        return *self._kernels()[1](points, load.pressure, load.shear), None

    def _kernels(self):
        corners = self.nodes.shape[1]
        if corners == 6:
            from .curved_faces import curved_forces, curved_forces_and_tangents  # not loaded with straight sides

            return curved_forces, curved_forces_and_tangents
        if corners == 3:
            return triangle_forces, triangle_forces_and_tangents
        return surface_forces, surface_forces_and_tangents


def surface_forces(corners, pressure, shear=None):
    """Forces N on the corners of every panel (p,4,3): (p a + s |a|) shared by `corner_shares`.

    `pressure` (p,) Pa pushes along the area vector a and follows it; `shear` (p,3) Pa keeps its global direction.
    """
    a = area_vectors(corners)
    force = pressure[:, None] * a
    if shear is not None:
        force = force + shear * np.linalg.norm(a, axis=1)[:, None]
    return corner_shares(corners)[:, :, None] * force[:, None, :]


def surface_forces_and_tangents(corners, pressure, shear=None):
    """Corner forces N (p,4,3) and their derivative with respect to the corners (p,12,12) N/m (load stiffness, sign +).

    d a = 1/2 sum_k dx_k x y_k with y_k = sum_l AREA[k,l] x_l, likewise for the moments A_i, so that both the turning
    of the force and the shift of its application point within the panel are exact.
    """
    c = corners - corners.mean(axis=1, keepdims=True)  # areas and shares do not depend on it; this keeps digits
    y_i = (SHARE.reshape(16, 4) @ c).reshape(-1, 4, 4, 3)  # (p, i, k, 3)
    y = AREA @ c
    moments = 0.5 * cross(c[:, None], y_i).sum(axis=2)  # (p, i, 3)
    a = moments.sum(axis=1)
    a2 = np.einsum("pc,pc->p", a, a)
    w = np.einsum("pic,pc->pi", moments, a) / a2[:, None]
    force = pressure[:, None] * a
    d_force = -pressure[:, None, None, None] * spin(y)  # (p, k, 3, 3)
    y_a = cross(y, a[:, None])  # (p, k, 3) = d(a.a)/2 / dx_k
    if shear is not None:
        norm = np.sqrt(a2)
        force = force + shear * norm[:, None]
        d_force = d_force + shear[:, None, :, None] * (y_a / norm[:, None, None])[:, :, None, :]
    # d w_i / d x_k = (y_ik x a + y_k x A_i - 2 w_i y_k x a) / a.a
    d_w = cross(y_i, a[:, None, None]) + cross(y[:, None], moments[:, :, None])
    d_w = (d_w - 2.0 * w[:, :, None, None] * y_a[:, None]) / a2[:, None, None, None]
    tangent = w[:, :, None, None, None] * d_force.transpose(0, 2, 1, 3)[:, None]  # (p, i, 3, k, 3)
    tangent = tangent + force[:, None, :, None, None] * d_w[:, :, None, :, :]
    p = len(corners)
    return w[:, :, None] * force[:, None, :], tangent.reshape(p, 12, 12)


def triangle_forces(corners, pressure, shear=None):
    """`surface_forces` of triangles with corners (p,3,3): a third of p a + s |a| on each, N (p,3,3)."""
    return triangle_forces_and_tangents(corners, pressure, shear, tangents=False)[0]


def triangle_forces_and_tangents(corners, pressure, shear=None, tangents=True):
    """Corner forces N (p,3,3) of triangles and their derivative by the corners (p,9,9) N/m.

    a = (x_1 - x_0) x (x_2 - x_0) / 2, so that da/dx_k = [e_k]x / 2 with the opposite edge e_k = x_{k+2} - x_{k+1},
    and d|a| = a.da / |a|.
    """
    a = 0.5 * cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    force = pressure[:, None] * a
    size = np.sqrt(np.einsum("pc,pc->p", a, a))[:, None]
    if shear is not None:
        force = force + shear * size
    third = np.repeat(force[:, None] / 3.0, 3, axis=1)
    if not tangents:
        return third, None
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    d_force = 0.5 * pressure[:, None, None, None] * spin(opposite)  # (p, k, 3, 3)
    if shear is not None:
        d_size = 0.5 * cross(a[:, None], opposite) / size[:, None]  # a.(e x dx) = (a x e).dx
        d_force = d_force + shear[:, None, :, None] * d_size[:, :, None, :]
    row = d_force.transpose(0, 2, 1, 3).reshape(-1, 1, 3, 9) / 3.0
    return third, np.broadcast_to(row, (len(row), 3, 3, 9)).reshape(-1, 9, 9)
