"""Wings for the tests: arched, swept, twisted, warped and randomly deformed, with stalling polars."""

import numpy as np

from aero.vortex_step import StripPolars, SurfaceGrid, VortexStep


def grid(strips, rows=2):
    """Interface grid of rows + 1 chord stations on strips + 1 sections, nodes numbered section by section."""
    return SurfaceGrid(np.arange((rows + 1) * (strips + 1)).reshape(strips + 1, -1), np.linspace(0.0, 1.0, rows + 1))


def nodes_of(leading_edge, trailing_edge, rows=2):
    """Interface nodes ((rows + 1) (n + 1), 3) of straight chords."""
    f = np.linspace(0.0, 1.0, rows + 1)[:, None]
    return (leading_edge[:, None] + f * (trailing_edge - leading_edge)[:, None]).reshape(-1, 3)


def arched_nodes(strips, noise=0.0, rng=None, rows=2):
    """An arched, swept, twisted wing of about 6.4 m span and 2 m chord, symmetric in y; `noise` (m) warps all nodes."""
    s = np.linspace(-1.0, 1.0, strips + 1)
    arc = 1.1 * s
    le = np.stack([0.9 * s**2, 3.6 * np.sin(arc), 3.6 * np.cos(arc)], axis=1)
    chord = 2.2 - 1.2 * s**2
    twist = 0.06 * np.cos(2.0 * s)
    down = -np.stack([0.0 * s, np.sin(arc), np.cos(arc)], axis=1)
    te = le + chord[:, None] * (np.cos(twist)[:, None] * [1.0, 0.0, 0.0] + np.sin(twist)[:, None] * down)
    nodes = nodes_of(le, te, rows)
    return nodes if noise == 0.0 else nodes + noise * rng.standard_normal(nodes.shape)


def stalling_tables(sections):
    """alpha (k,) rad and tables cl, cd, cm (sections, k): linear, then a steep loss of lift at 9 to 15 degrees."""
    alpha = np.deg2rad(np.arange(-15.0, 31.0))
    stall = np.deg2rad(np.linspace(15.0, 9.0, sections))[:, None]
    separated = 0.5 * (1.0 + np.tanh((alpha - stall) / np.deg2rad(1.2)))
    cl = (1 - separated) * (0.3 + 5.8 * alpha) + separated * 0.9 * np.sin(2.0 * alpha + 0.4)
    cd = 0.03 + 0.02 * alpha**2 + separated * np.sin(np.abs(alpha)) ** 2
    return alpha, cl, cd, -0.08 + 0.1 * separated * alpha


def stalling_wing(strips, rows=2, **choices):
    """Vortex-step wing with polars that change along the span."""
    alpha, cl, cd, cm = stalling_tables(3)
    position = (np.arange(strips) + 0.5) / strips
    across = 1.0 - np.abs(2.0 * position - 1.0)  # 0 at both tips, so that symmetric wings have symmetric polars
    return VortexStep(
        StripPolars.from_tables(alpha, cl, cd, cm, [0.0, 0.5, 1.0], across), grid(strips, rows), **choices
    )


def linear_wing(strips, slope=2.0 * np.pi, cd=0.0, cm=0.0, cl0=0.0, rows=2, **choices):
    """Wing with cl = cl0 + slope alpha and constant cd and cm within 40 degrees."""
    alpha = np.deg2rad([-40.0, 40.0])
    flat = np.ones((1, 2))
    tables = [cl0 + slope * alpha], cd * flat, cm * flat
    return VortexStep(StripPolars.from_tables(alpha, *tables, [0.0], np.zeros(strips)), grid(strips, rows), **choices)


def wind(alpha, speed=12.0):
    """Wind (3,) m/s at an angle alpha (rad) to the x axis, from below."""
    return speed * np.array([np.cos(alpha), 0.0, np.sin(alpha)])


def rotation(axis, angle):
    """Rotation matrix about an axis by an angle (rad), Rodrigues."""
    k = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def panel_corner_forces(corners, pressure, shear):
    """Forces (4,3) N on the corners (4,3) of one bilinear panel, by 3-point Gauss quadrature of its parametrisation.

    (p a + s |a|) with the vector area a, shared as int N_i dA.a / |a|^2 with dA = x_u x x_v du dv.
    """
    points, weights = np.polynomial.legendre.leggauss(3)  # exact to degree 5; the integrand is quadratic in u and v
    share, area = np.zeros((4, 3)), np.zeros(3)
    for u, wu in zip(points, weights, strict=True):
        for v, wv in zip(points, weights, strict=True):
            n = 0.25 * np.array([(1 - u) * (1 - v), (1 + u) * (1 - v), (1 + u) * (1 + v), (1 - u) * (1 + v)])
            n_u = 0.25 * np.array([-(1 - v), 1 - v, 1 + v, -(1 + v)])
            n_v = 0.25 * np.array([-(1 - u), -(1 + u), 1 + u, 1 - u])
            da = wu * wv * np.cross(n_u @ corners, n_v @ corners)
            area += da
            share += n[:, None] * da
    share = share @ area / (area @ area)
    return share[:, None] * (pressure * area + shear * np.linalg.norm(area))
