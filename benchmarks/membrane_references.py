"""Closed forms and one-dimensional solutions that membranes are held against, in terms without dimension.

Membranes here have the linear law of 2nd Piola-Kirchhoff stress and Green-Lagrange strain, S = E h / (1 - nu^2)
((1 - nu) E + nu tr(E) I) in N/m of the unstressed fabric of thickness h, and a pressure that follows the surface,
except where a docstring says that a source is linear or of small slope. Nothing here uses elements.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

TERMS = 80  # of Hencky's series: the last one is below 1e-30 of the first for any Poisson's ratio from 0 to 0.5
START = 1e-5  # radius over that of the edge where shooting begins; what it leaves out is of its square
TOLERANCE = 1e-13  # of the integration, relative


@dataclass(frozen=True, eq=False)
class HenckySeries:
    """Hencky's clamped disc of radius a under q = p a / (E h), small slopes, dead pressure (Hencky 1915, Fichter 1997).

    Deflection w = a q^(1/3) W(c), resultants N = E h q^(2/3) n(c) at c = radius / a, where n W' = -c / 2 and
    c ((c^2 n)' / c)' = -W'^2 / 2; `radial_terms` are those of n in powers of c^2, `slope_terms` those of 1 / n.
    """

    nu: float
    radial_terms: np.ndarray
    slope_terms: np.ndarray

    @property
    def b0(self):
        """Hencky's constant, 4 n at the centre."""
        return 4.0 * self.radial_terms[0]

    def deflection(self, q, c=0.0):
        """w / a."""
        k = np.arange(TERMS)
        terms = self.slope_terms / (4.0 * (k + 1.0))
        return q ** (1.0 / 3.0) * (terms.sum() - _power_sum(terms, c) * np.asarray(c) ** 2)

    def radial(self, q, c=0.0):
        """N_r / (E h)."""
        return q ** (2.0 / 3.0) * _power_sum(self.radial_terms, c)

    def hoop(self, q, c=0.0):
        """N_t / (E h), N_t = (c N_r)'."""
        return q ** (2.0 / 3.0) * _power_sum((2.0 * np.arange(TERMS) + 1.0) * self.radial_terms, c)


def _power_sum(terms, c):
    return np.polynomial.polynomial.polyval(np.asarray(c, dtype=float) ** 2, terms)


def _radial_terms(first):
    """Terms (TERMS,) of n with the first given, and those of 1 / n: 4 k (k + 1) n_k = -1/8 (1 / n^2)_(k-1)."""
    n, m = np.zeros(TERMS), np.zeros(TERMS)
    n[0], m[0] = first, 1.0 / first
    for k in range(1, TERMS):
        n[k] = -(m[:k] @ m[:k][::-1]) / (32.0 * k * (k + 1.0))
        m[k] = -(n[1 : k + 1] @ m[:k][::-1]) / first
    return n, m


def hencky_series(nu):
    """The series for a Poisson's ratio, with the first term for which the edge does not move: N_t = nu N_r there."""
    weight = 2.0 * np.arange(TERMS) + 1.0 - nu
    first = brentq(lambda c: weight @ _radial_terms(c)[0], 0.36, 0.8, xtol=1e-15, rtol=1e-15)
    return HenckySeries(nu, *_radial_terms(first))


@dataclass(frozen=True, eq=False)
class AxisymmetricMembrane:
    """A clamped disc of radius a under q = p a / (E h), of the membrane model of this module, at finite slope.

    `deflection` of the centre over a. Resultants over E h: `centre`, equal in all directions, `edge_radial` and
    `edge_hoop`, 2nd Piola-Kirchhoff; `true_centre`, `true_edge_radial` and `true_edge_hoop` per current length.
    `profile` (3,k): radius before, radius after and deflection over a.
    """

    deflection: float
    centre: float
    edge_radial: float
    edge_hoop: float
    true_centre: float
    true_edge_radial: float
    true_edge_hoop: float
    profile: np.ndarray


def axisymmetric_membrane(q, nu):
    """The disc under q by shooting from the centre, to 1e-9.

    With u = r / R and s = R S_1 r' / R, where r(R) is the radius after and R before, equilibrium along the axis has the
    first integral R S_1 z' = -p r^2 / 2, and (R S_1 r')' = S_2 r / R + p r z'. The stretch of the meridian l follows
    from S_1 l = |(s, p u r / 2)|. The unknown is the stretch of the centre for which the edge stays where it is.
    """
    stiffness = 1.0 / (1.0 - nu * nu)

    def state(radius, u, s):
        """Stretch along the meridian, S_1 and S_2 over E h, and z'."""
        hoop = 0.5 * (u * u - 1.0)
        pull = np.hypot(s, 0.5 * q * u * u * radius)
        stretch = _meridian_stretch(pull, nu * hoop, stiffness)
        s1 = stiffness * (0.5 * (stretch**2 - 1.0) + nu * hoop)
        s2 = stiffness * (hoop + nu * 0.5 * (stretch**2 - 1.0))
        return stretch, s1, s2, -0.5 * q * u * u * radius / s1

    def slopes(radius, y):
        u, s, _ = y
        _, s1, s2, fall = state(radius, u, s)
        return [(s / s1 - u) / radius, (s2 * u - s) / radius + q * u * fall, fall]

    def shot(stretch):
        s0 = stiffness * (1.0 + nu) * 0.5 * (stretch**2 - 1.0)
        return solve_ivp(
            slopes, (START, 1.0), [stretch, s0 * stretch, 0.0], method="DOP853", rtol=TOLERANCE, atol=1e-15
        )

    guess = 1.0 + hencky_series(nu).radial(q) * (1.0 - nu)  # the strain of the centre
    strain = guess - 1.0
    stretch = brentq(lambda v: shot(v).y[0, -1] - 1.0, 1.0 + 0.7 * strain, 1.0 + 1.4 * strain, xtol=1e-14, rtol=1e-14)
    found = shot(stretch)
    u, s, z = found.y[:, -1]
    along, edge_radial, edge_hoop, _ = state(1.0, u, s)
    centre = stiffness * (1.0 + nu) * 0.5 * (stretch**2 - 1.0)
    profile = np.stack([found.t, found.t * found.y[0], found.y[2] - z])
    # between the centre and START the deflection is q u^2 R^2 / (4 S)
    below = 0.25 * q * stretch**2 * START**2 / centre
    return AxisymmetricMembrane(
        below - z, centre, edge_radial, edge_hoop, centre, edge_radial * along / u, edge_hoop * u / along, profile
    )


def _meridian_stretch(pull, hoop, stiffness):
    """The stretch l above zero with stiffness (l^2 - 1 + 2 hoop) / 2 l = pull: the one real root of a cubic."""
    b, c = 2.0 * hoop - 1.0, -2.0 * pull / stiffness
    stretch = 1.0 + np.maximum(pull / stiffness - hoop, 0.0)
    for _ in range(60):  # Newton from above on a convex function
        step = (stretch * (stretch * stretch + b) + c) / (3.0 * stretch * stretch + b)
        stretch = stretch - step
        if abs(step) <= 1e-16 * stretch:
            break
    return stretch


def sphere_stretch(q, nu):
    """Stretch of a sphere of radius R under q = p R / (E h): E h / (1 - nu) (l^2 - 1) / 2 = p R l / 2."""
    half = 0.5 * q * (1.0 - nu)
    return half + np.sqrt(half * half + 1.0)


def cylinder_stretches(q, nu, ends="caps"):
    """Stretches around and along a cylinder of radius R under q = p R / (E h), far from its ends.

    Ends with "caps" carry the pressure on them: S_t = q l_x, S_x = q l_t^2 / (2 l_x) over E h; "held" ends do not move:
    l_x = 1 and l_t^2 = 1 + 2 q (1 - nu^2).
    """
    if ends == "held":
        return np.sqrt(1.0 + 2.0 * q * (1.0 - nu * nu)), 1.0
    if ends != "caps":
        raise ValueError(f"ends of a cylinder are 'caps' or 'held', not '{ends}'.")

    def gap(stretch):
        around, along = stretch
        hoop, axial = q * along, 0.5 * q * around**2 / along
        return [around**2 - 1.0 - 2.0 * (hoop - nu * axial), along**2 - 1.0 - 2.0 * (axial - nu * hoop)]

    found = root(gap, [1.0 + q * (1.0 - 0.5 * nu), 1.0 + q * (0.5 - nu)], tol=1e-14)
    return float(found.x[0]), float(found.x[1])


def shear_panel(gamma):
    """Shear stress over E, largest principal stress over E, and angle rad of its wrinkles to the edge, of a long panel
    that shears by a small `gamma` between parallel edges of fixed distance in a pure tension field (Wagner 1929): its
    shear modulus is E / 4, that of uniaxial tension at 45 degrees, whatever Poisson's ratio.
    """
    return 0.25 * gamma, 0.5 * gamma, 0.25 * np.pi


@dataclass(frozen=True)
class WrinkledTube:
    """An inflated tube in pure bending (Comer and Levy 1963): `moment` over p r^3, `curvature` times E h / p, half the
    angle `slack` rad of its slack part, the largest axial resultant `tension` over p r.
    """

    moment: float
    curvature: float
    slack: float
    tension: float


FIRST_WRINKLE, COLLAPSE = 0.5 * np.pi, np.pi  # moments over p r^3
MOST_SLACK = np.pi - 1e-3  # rad; the curvature is 5e9 there, and of what is left differences are rounding
WRINKLE_CURVATURE = 0.5  # curvature times E h / p at the first wrinkle


def tube_of_slack(slack):
    """The tube whose part within `slack` rad, from 0 to below pi, of the inner side of the bend is slack.

    Axial resultants p r (pi / 2) (cos t0 - cos t) / (sin t0 + (pi - t0) cos t0) carry the pressure p pi r^2 on the
    ends. Radius and E h are those of the inflated tube, with strains p r / (E h) that are small.
    """
    lever = np.sin(slack) + (np.pi - slack) * np.cos(slack)
    moment = 0.25 * np.pi * (2.0 * np.pi - 2.0 * slack + np.sin(2.0 * slack)) / lever
    curvature = 0.5 * np.pi / lever
    return WrinkledTube(float(moment), float(curvature), float(slack), float(curvature * (1.0 + np.cos(slack))))


def tube_of_curvature(curvature):
    """The tube at a curvature times E h / p; taut and linear, with E I = E h pi r^3, up to WRINKLE_CURVATURE."""
    if curvature <= WRINKLE_CURVATURE:
        return WrinkledTube(np.pi * curvature, curvature, 0.0, 0.5 + curvature)
    slack = brentq(lambda t: tube_of_slack(t).curvature - curvature, 0.0, MOST_SLACK, xtol=1e-14)
    return tube_of_slack(slack)


def tube_of_moment(moment):
    """The tube at a moment over p r^3; ValueError where there is none, from COLLAPSE on and 1e-6 below it."""
    if moment >= tube_of_slack(MOST_SLACK).moment:
        raise ValueError(f"a tube collapses at pi p r^3; it carries no moment of {moment:g} p r^3.")
    if moment <= FIRST_WRINKLE:
        return tube_of_curvature(moment / np.pi)
    slack = brentq(lambda t: tube_of_slack(t).moment - moment, 0.0, MOST_SLACK, xtol=1e-14)
    return tube_of_slack(slack)


@dataclass(frozen=True)
class WrinkledStrip:
    """A strip of height H and thickness h under the tension P and a moment in its plane (Stein and Hedgepeth 1961):
    `moment` over P H, `curvature` times E h H^2 / P, height `slack` of its slack band over H, largest `stress` over
    that of P alone.
    """

    moment: float
    curvature: float
    slack: float
    stress: float


STRIP_WRINKLE, STRIP_COLLAPSE = 1.0 / 6.0, 0.5  # moments over P H


def strip_of_moment(moment):
    """The strip at a moment over P H: taut up to STRIP_WRINKLE; ValueError from STRIP_COLLAPSE on, where there is none.

    In the wrinkled strip stress rises linearly from the slack band to the other edge, so P stands at a third of its
    height: b / H = 3 M / (P H) - 1/2, and P = E h kappa (H - b)^2 / 2.
    """
    if moment >= STRIP_COLLAPSE:
        raise ValueError(f"a strip collapses at P H / 2; it carries no moment of {moment:g} P H.")
    if moment <= STRIP_WRINKLE:
        return WrinkledStrip(moment, 12.0 * moment, 0.0, 1.0 + 6.0 * moment)
    slack = 3.0 * moment - 0.5
    return WrinkledStrip(moment, 2.0 / (1.0 - slack) ** 2, slack, 2.0 / (1.0 - slack))


def strip_of_curvature(curvature):
    """The strip at a curvature times E h H^2 / P: 2 M / (P H) = kappa / 6 up to 2, then 1 - (2/3) (2 / kappa)^(1/2)."""
    if curvature <= 2.0:
        return strip_of_moment(curvature / 12.0)
    return strip_of_moment(0.5 - np.sqrt(2.0 / curvature) / 3.0)
