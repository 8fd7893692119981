"""Section loads as pressures and shears on the interface panels: the same force and moment, strip by strip."""

from dataclasses import dataclass

import numpy as np

_MASS = np.array([[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]]) / 36.0


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """How the strips lie on the interface mesh.

    `sections` (n+1, 3) node indices of leading edge, middle and trailing edge station of each section, `fractions`
    (3,) of the chord where they stand, `panels` (2n, 4): the fore panels of all strips, then the aft ones, with the
    corners (fore, aft) of the strip's first section, then (aft, fore) of its second, so that area vectors point to
    suction.
    """

    sections: np.ndarray
    fractions: np.ndarray

    @property
    def panels(self):
        """Node indices (2n, 4)."""
        first, second = self.sections[:-1], self.sections[1:]
        return np.concatenate(
            [np.stack([first[:, c], first[:, c + 1], second[:, c + 1], second[:, c]], axis=1) for c in (0, 1)]
        )


@dataclass(frozen=True, eq=False)
class PanelGeometry:
    """Area vectors m^2 and their squares, centroids m, and chord fractions of the centroids of the panels of n
    strips.
    """

    area: np.ndarray  # (p, 3)
    area2: np.ndarray  # (p,)
    centroid: np.ndarray  # (p, 3)
    fraction: np.ndarray  # (p,)


def panel_geometry(corners, fractions):
    """Geometry of panels with corners (p,4,3) at chord `fractions` (p,4).

    The centroid weighs the corners with int N_i dA over the bilinear panel, as the receiver shares the panel force.
    """
    d1, d2 = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    area = 0.5 * np.cross(d1, d2)
    after = np.roll(corners, -1, axis=1) - corners
    normals = np.cross(after, -np.roll(after, 1, axis=1))  # corner normals: bilinear panel's dA at its corners
    area2 = np.einsum("pk,pk->p", area, area)
    shares = np.einsum("ij,pj->pi", _MASS, np.einsum("pjk,pk->pj", normals, area)) / area2[:, None]
    return PanelGeometry(
        area, area2, np.einsum("pi,pik->pk", shares, corners), np.einsum("pi,pi->p", shares, fractions)
    )


def two_panel_loads(force, moment, span, fore, aft, point=0.25):
    """Forces (n,3) N on the fore and aft panels that carry a strip's force and moment, and where and about what.

    The strip force (n,3) acts where the line through the two panel centroids crosses the chord fraction `point`; the
    moment (n,) N m turns about the span direction made normal to that line, nose-up positive. With d from the fore
    to the aft centroid and t the fraction of d: F_aft = t F + g, F_fore = (1 - t) F - g, and the couple
    g = M m x d / d.d. Returns (steady parts (fore, aft), couples (fore, aft), point (n,3), moment vector (n,3)).
    """
    d = aft.centroid - fore.centroid
    d2 = np.einsum("ik,ik->i", d, d)
    t = ((point - fore.fraction) / (aft.fraction - fore.fraction))[:, None]
    axis = span - (np.einsum("ik,ik->i", span, d) / d2)[:, None] * d
    axis /= np.sqrt(np.einsum("ik,ik->i", axis, axis))[:, None]
    turning = moment[:, None] * axis
    g = np.cross(turning, d) / d2[:, None]
    return ((1.0 - t) * force, t * force), (-g, g), fore.centroid + t * d, turning


def pressure_and_shear(steady, couple, panels, follow):
    """Pressure (p,) Pa and shear (p,3) Pa with p a + s |a| = steady + couple, forces (p,3) N on the panels.

    The couple turns with the surface and goes into pressure along the normal. The steady part is given its direction
    by the flow, not by the surface: it stays in the shear, which keeps its direction, unless `follow` asks for its
    normal component as pressure. What is left along the surface is shear in any case.
    """
    carried = couple + steady if follow else couple
    pressure = np.einsum("pk,pk->p", carried, panels.area) / panels.area2
    rest = steady + couple - pressure[:, None] * panels.area
    return pressure, rest / np.sqrt(panels.area2)[:, None]
