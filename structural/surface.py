"""Loads on four-node (or collapsed three-node) panels, follower pressure and dead-direction shear, and on lines."""

import numpy as np

from .rotations import cross, spin

# int N_i N_j over the unit square, and the corner normals n_j = (x_{j+1} - x_j) x (x_{j-1} - x_j) of a bilinear panel
# written as sums of x_k x x_l: together A_i = 1/2 sum_kl SHARE[i,k,l] x_k x x_l is int N_i n dA, exactly.
_MASS = np.array([[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]]) / 36.0


def _share_matrix():
    corner = np.zeros((4, 4, 4))
    for j in range(4):
        after, before = (j + 1) % 4, (j - 1) % 4
        for k, l in ((after, before), (before, j), (j, after)):
            corner[j, k, l] += 1.0
            corner[j, l, k] -= 1.0
    return np.einsum("ij,jkl->ikl", _MASS, corner)


SHARE = _share_matrix()
AREA = SHARE.sum(axis=0)


def area_vectors(corners):
    """Area vectors m^2 (p,3) of panels with corner points (p,4,3): half the cross product of the diagonals."""
    return 0.5 * cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


def corner_shares(corners):
    """Share of every corner in the panel force (p,4), summing to one: int N_i dA over the bilinear panel, along a."""
    c = corners - corners.mean(axis=1, keepdims=True)
    moments = 0.5 * cross(c[:, None], (SHARE.reshape(16, 4) @ c).reshape(-1, 4, 4, 3)).sum(axis=2)
    a = moments.sum(axis=1)
    return np.einsum("pic,pc->pi", moments, a) / np.einsum("pc,pc->p", a, a)[:, None]


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


def line_load_forces(ends, load):
    """Forces N (k,2,3) at the `ends` (k,2,3) m of straight lines: half of load (k,3) N/m times current length each."""
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None] * load
    return np.stack([half, half], axis=1)


def line_load_forces_and_tangents(ends, load):
    """`line_load_forces`, and their derivative (k,6,6) N/m with respect to the ends: load (x) dl/dx / 2, l the length.

    A load keeps its direction and its size per length; a line without length has no derivative and gets zeros.
    """
    d = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(d, axis=1)[:, None]
    u = d / np.where(length > 0.0, length, 1.0)
    slope = np.concatenate([-u, u], axis=1)  # dl/dx
    half = 0.5 * length * load
    row = 0.5 * load[:, :, None] * slope[:, None, :]
    return np.stack([half, half], axis=1), np.concatenate([row, row], axis=1)
