"""Section loads as pressures and shears on the interface panels: the same force and moment, strip by strip."""

from dataclasses import dataclass

import numpy as np

from interface.mesh import station_panels
from interface.panels import MASS, area_vectors
from interface.vectors import cross


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """How the strips lie on the interface mesh.

    `sections` (n+1, k+1) node indices of the stations of each section from leading to trailing edge, `fractions`
    (k+1,) of the chord where they stand, k >= 2; `panels` (k n, 4): the foremost panels of all strips, then the next
    ones, with the corners (fore, aft) of the strip's first section, then (aft, fore) of its second, so that area
    vectors point to suction.
    """

    sections: np.ndarray
    fractions: np.ndarray

    @property
    def rows(self):
        """Number k of panels along the chord."""
        return len(self.fractions) - 1

    @property
    def panels(self):
        """Node indices (k n, 4)."""
        return station_panels(self.sections)

    @property
    def shapes(self):
        """Shares (2, k) of the panels in a flat plate's load and in that of a parabolic camber at zero incidence.

        Thin-airfoil theory, with x / c = (1 - cos theta) / 2: lift up to theta (theta + sin theta) / pi, centred at a
        quarter chord, and (2 theta - sin 2 theta) / 2 pi, centred at half. With two panels a combination of both is
        any load of the two, so that they are taken one each.
        """
        if self.rows == 2:
            return np.eye(2)
        theta = np.arccos(1.0 - 2.0 * np.clip(self.fractions, 0.0, 1.0))
        plate = np.diff((theta + np.sin(theta)) / np.pi)
        camber = np.diff((2.0 * theta - np.sin(2.0 * theta)) / (2.0 * np.pi))
        return np.stack([plate / plate.sum(), camber / camber.sum()])

    def camber(self, sections, normal):
        """Change of zero-lift angle (n,) rad and of c_m about the quarter chord (n,) by the camber of the strips.

        `sections` (n+1,k+1,3) m are the stations in the present shape, `normal` (n,3) of the strips; the heights over
        the chord, mean of both sections, are taken as changes of the camber line with straight pieces between the
        stations. Thin-airfoil theory: alpha_0 = -int dz/dx (cos theta - 1) dtheta / pi, c_m = -pi (A_1 - A_2) / 4 with
        A_n = 2 int dz/dx cos(n theta) dtheta / pi.
        """
        chord = sections[:, -1] - sections[:, 0]
        length = np.sqrt(np.einsum("ik,ik->i", chord, chord))
        line = sections[:, 0, None] + self.fractions[:, None] * chord[:, None]
        off = (sections - line) / length[:, None, None]
        height = np.einsum("ijk,ik->ij", 0.5 * (off[:-1] + off[1:]), normal)
        slope = np.diff(height, axis=1) / np.diff(self.fractions)
        theta = np.arccos(1.0 - 2.0 * np.clip(self.fractions, 0.0, 1.0))
        zero_lift = -slope @ np.diff(np.sin(theta) - theta) / np.pi
        first, second = (2.0 / np.pi * (slope @ np.diff(np.sin(k * theta) / k)) for k in (1, 2))
        return zero_lift, -0.25 * np.pi * (first - second)


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
    area = area_vectors(corners)
    after = np.roll(corners, -1, axis=1) - corners
    normals = cross(after, -np.roll(after, 1, axis=1))  # corner normals: bilinear panel's dA at its corners
    area2 = np.einsum("pk,pk->p", area, area)
    shares = np.einsum("ij,pj->pi", MASS, np.einsum("pjk,pk->pj", normals, area)) / area2[:, None]
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
    g = cross(turning, d) / d2[:, None]
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
