"""Geometry of four-node panels, of which triangles repeat a corner: areas, and how a force is shared by the corners.

A panel is the bilinear surface through its corners. Whoever sends a load and whoever receives it share it alike, by
int N_i dA, so that its point of application is the same on both sides.
"""

import numpy as np

from .vectors import cross

# int N_i N_j over the unit square, and the corner normals n_j = (x_{j+1} - x_j) x (x_{j-1} - x_j) of a bilinear panel
# written as sums of x_k x x_l: together A_i = 1/2 sum_kl SHARE[i,k,l] x_k x x_l is int N_i n dA, exactly.
MASS = np.array([[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]]) / 36.0


def _share_matrix():
    corner = np.zeros((4, 4, 4))
    for j in range(4):
        after, before = (j + 1) % 4, (j - 1) % 4
        for k, l in ((after, before), (before, j), (j, after)):
            corner[j, k, l] += 1.0
            corner[j, l, k] -= 1.0
    return np.einsum("ij,jkl->ikl", MASS, corner)


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
