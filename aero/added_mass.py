"""Inertia of the air that moves with wings and lines."""

import numpy as np

from interface.panels import area_vectors


def wing_added_mass(points, panels, sections, density, coefficient=1.0):
    """Inertia (n,3,3) kg of the air at the nodes `points` (n,3) m of a wing, along its normals only.

    `coefficient` times that of a flat plate across its chord, rho pi c^2 / 4 per span (thin-airfoil theory), spread
    over the panels of every strip by their area, a quarter to each corner. `panels` (k s, 4) lie in k rows from front
    to rear, `sections` (s+1, k+1) are the stations.
    """
    a = area_vectors(points[panels])
    area = np.linalg.norm(a, axis=1)
    chord = np.linalg.norm(points[sections[:, -1]] - points[sections[:, 0]], axis=1)
    strip = np.tile(0.5 * (chord[:-1] + chord[1:]), sections.shape[1] - 1)
    of_panel = (0.25 * np.pi * coefficient * density * strip / area)[:, None, None]
    of_panel = 0.25 * of_panel * (a[:, :, None] * a[:, None, :])  # m n n^T of the panel, a quarter to each corner
    blocks = np.zeros((len(points), 3, 3))
    for corner in panels.T:
        np.add.at(blocks, corner, of_panel)
    return blocks


def line_inertia(ends, diameter, acceleration, density, coefficient=1.0):
    """Force N/m (k,3) that accelerates the air around lines between `ends` (k,2,3) m by `acceleration` (k,3) m/s^2.

    `coefficient` rho pi d^2 / 4 times the acceleration across each line; 1 is a cylinder in potential flow.
    """
    axis = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(axis, axis=1)[:, None]
    u = axis / np.where(length > 0.0, length, 1.0)
    across = acceleration - np.einsum("kc,kc->k", acceleration, u)[:, None] * u
    displaced = 0.25 * np.pi * density * diameter**2
    return (coefficient * displaced)[:, None] * across
