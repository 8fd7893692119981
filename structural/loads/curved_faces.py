"""Follower pressure and traction on curved triangles of six nodes, which keep their share of int N_i dA each."""

import numpy as np

from interface.vectors import cross, spin
from structural.triangles import DEGREE_4, t6_functions, t6_slopes


def curved_forces(points, pressure, shear=None):
    """Forces N (p,6,3) on the nodes of curved triangles at `points` (p,6,3): int N_i (p n + s) dA."""
    return curved_forces_and_tangents(points, pressure, shear, tangents=False)[0]


def curved_forces_and_tangents(points, pressure, shear=None, tangents=True):
    """Nodal forces N (p,6,3) of curved triangles and their derivative by the nodes (p,18,18) N/m.

    n dA = g_1 x g_2 of the covariant bases g_a = sum_k x_k dN_k/dxi_a, so that its derivative by x_k is
    dN_k/dxi_2 [g_1]x - dN_k/dxi_1 [g_2]x. Of pressure the integrand has degree 4, which the rule has too.
    """
    at, weights = DEGREE_4
    shares, slopes = weights[:, None] * t6_functions(at), t6_slopes(at)
    g1, g2 = (np.einsum("qk,pkc->pqc", slopes[:, :, a], points) for a in (0, 1))
    normal = cross(g1, g2)
    density = pressure[:, None, None] * normal
    size = np.sqrt(np.einsum("pqc,pqc->pq", normal, normal))[..., None]
    if shear is not None:
        density = density + shear[:, None] * size
    forces = np.einsum("qi,pqc->pic", shares, density)
    if not tangents:
        return forces, None
    d_normal = slopes[:, :, 1, None, None] * spin(g1)[:, :, None] - slopes[:, :, 0, None, None] * spin(g2)[:, :, None]
    d_density = pressure[:, None, None, None, None] * d_normal  # (p, q, k, 3, 3)
    if shear is not None:
        d_size = np.einsum("pqc,pqkcd->pqkd", normal / size, d_normal)
        d_density = d_density + shear[:, None, None, :, None] * d_size[:, :, :, None, :]
    tangent = np.tensordot(d_density, shares, axes=(1, 0)).transpose(0, 4, 2, 1, 3)
    return forces, tangent.reshape(len(points), 18, 18)
