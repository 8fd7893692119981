"""Inflatable tubes: bending, shear, torsion and collapse as laws of moment, curvature and twist rate.

`TubeSection` makes the end moments of an element from any bending law, by its flexibility. There are two laws.
`breukels_tube` turns the fits of Breukels (2011), which are tip load over tip deflection of a cantilever of 1 m, into
moment over curvature, so that the answer does not depend on how a tube is divided. `inflatable_tube` is the Timoshenko
beam of Le van and Wielgosz (2005) with the wrinkling of Comer and Levy (1963): it takes the moduli of the fabric
instead of fits.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Protocol, Self

import numpy as np

from interface.validity import Criterion

from .sections import Section, coupled, linear_shear, shortening

# Beyond collapse the tangent stiffness is this part of the initial EI (or what the law has left, if less). No source
# measures it; it keeps the tangent regular and the moment rising, so that a collapsed tube can be solved.
AFTER_COLLAPSE = 0.02
# Gauss-Lobatto points for the flexibility of a tube: its curvature grows steeply towards the loaded end.
_POINTS = 9
# Newton iterations for the end moments, and the relative change that ends them.
_MAX_ITERATIONS, _TOLERANCE = 60, 1e-12

# What inflated tubes are judged by. A tube begins to wrinkle where bending has taken the tension of the pressure on one
# side, at p pi r^3 / 2 whatever its law; up to there it is a beam, and from there on it softens towards its collapse.
TUBE_CRITERIA = (
    Criterion("largest_moment_over_wrinkling", "tube moment over wrinkling moment", 1.0, "Comer and Levy (1963)"),
    Criterion(
        "largest_moment_over_collapse", "tube moment over collapse moment", 1.0,
        "Breukels (2011), LEI thesis, section 5.2.2",
    ),
    Criterion(
        "largest_tube_strain", "tube strain", 0.01, "LEI thesis, section 7.1: every element stretches by less than 1 %",
        percent=True,
    ),
)  # fmt: skip


def _lobatto(count):
    inner = np.polynomial.legendre.Legendre.basis(count - 1).deriv().roots()
    x = np.concatenate([[-1.0], np.sort(inner.real), [1.0]])
    w = 2.0 / (count * (count - 1) * np.polynomial.legendre.Legendre.basis(count - 1)(x) ** 2)
    return 0.5 * (1.0 + x), 0.5 * w


_XI, _WEIGHT = _lobatto(_POINTS)


class BendingLaw(Protocol):
    """Curvature over moment of tubes, arrays (e,), up to the moment of their collapse."""

    @property
    def collapse(self) -> np.ndarray:
        """Moments (e,) N m at collapse."""

    def bend(self, moment):
        """Curvature 1/m and its slope (e,g) at moments (e,g) N m, zero or more, within the collapse."""

    def select(self, rows) -> Self:
        """The law of the chosen elements."""


@dataclass(frozen=True, eq=False)
class TubeSection(Section):
    """Section of inflated tubes, arrays (e,): shear `kGA` N, `EA` N, torque T = peak atan(rate phi'); `radius` m and
    the moment `wrinkling` N m at which the fabric begins to wrinkle.

    The end moments follow from the rotations by the flexibility of the element, theta_1 = -int (1 - xi) kappa l0 dxi
    and theta_2 = int xi kappa l0 dxi (plus shear) with the linear moment M = -(1 - xi) m_1 + xi m_2: exact for one
    element whatever the law, if the moment is linear.
    """

    EA: np.ndarray
    kGA: np.ndarray
    peak: np.ndarray  # N m
    rate: np.ndarray  # m
    bending: BendingLaw
    radius: np.ndarray  # m
    wrinkling: np.ndarray  # N m

    def response(self, natural, l0):
        """Forces (e,6) and tangents (e,6,6) at the natural deformations (e,6)."""
        stiffness = self.initial_bending
        shear = 12.0 * stiffness / (self.kGA * l0 * l0)
        q = shortening(np.repeat(1.0 / (1.0 + shear)[:, None] ** 2, 2, axis=1))

        def torsion(psi):
            turn = self.rate * psi / l0
            return self.peak * np.arctan(turn), self.peak * self.rate / l0 / (1.0 + turn * turn)

        return coupled(
            natural,
            l0,
            q,
            lambda delta: (self.EA / l0 * delta, self.EA / l0),
            lambda theta: self._end_moments(theta, l0, stiffness, shear),
            torsion,
        )

    @cached_property
    def initial_bending(self):
        """EI (e,) N m^2 of the tube without load."""
        return 1.0 / self.bending.bend(np.zeros((len(self.EA), 1)))[1][:, 0]

    @cached_property
    def _beyond(self):
        """Slope (e,1) of curvature over moment beyond collapse."""
        slope = self.bending.bend(self.bending.collapse[:, None])[1]
        return np.maximum(slope, 1.0 / (AFTER_COLLAPSE * self.initial_bending[:, None]))

    def _curvature(self, m):
        """Vectors of curvature (e,g,2) and their derivative (e,g,2,2) with respect to moments m (e,g,2)."""
        size = np.sqrt(np.einsum("egk,egk->eg", m, m))
        end = self.bending.collapse[:, None]
        kappa, slope = self.bending.bend(np.minimum(size, end))
        after = self._beyond
        beyond = size > end
        kappa = np.where(beyond, kappa + after * (size - end), kappa)
        slope = np.where(beyond, after, slope)
        small = size < 1e-12 * end
        secant = np.where(small, slope, kappa / np.where(small, 1.0, size))
        unit = m / np.where(small, 1.0, size)[..., None]
        c = secant[..., None, None] * np.eye(2)
        c = c + (slope - secant)[..., None, None] * (unit[..., :, None] * unit[..., None, :])
        return secant[..., None] * m, c

    def _rotations(self, ends, l0):
        """Rotations (e,4) of the ends under end moments (e,2,2: end, axis), and their derivative (e,4,4)."""
        shape = np.stack([_XI - 1.0, _XI])  # moment at the points from either end
        kappa, c = self._curvature(np.einsum("ig,eik->egk", shape, ends))
        weighted = shape * _WEIGHT
        theta = l0[:, None, None] * np.einsum("ig,egk->eik", weighted, kappa)
        flexibility = l0[:, None, None, None, None] * np.einsum("ig,jg,egkl->eikjl", weighted, shape, c)
        slide = (1.0 / (self.kGA * l0))[:, None, None]
        theta = theta + slide * ends.sum(axis=1)[:, None]
        flexibility += slide[..., None, None] * np.eye(2)[:, None, :]
        return theta.reshape(-1, 4), flexibility.reshape(-1, 4, 4)

    def _end_moments(self, theta, l0, stiffness, shear):
        """End moments (e,4) and tangent (e,4,4) at rotations (e,4): Newton on the flexibility.

        The flexibility is that of a convex complementary energy. From the moments of the initial stiffness, which are
        too large, Newton comes down on the solution; steps that do not lower the gap are shortened.
        """
        ends = linear_shear(theta, stiffness, l0, shear)
        found, flexibility = self._rotations(ends.reshape(-1, 2, 2), l0)
        scale = np.abs(theta).max(axis=1) + 1e-300
        gap = theta - found
        for _ in range(_MAX_ITERATIONS):
            off = np.abs(gap).max(axis=1) / scale
            if not np.any(off > _TOLERANCE):
                break
            step = np.linalg.solve(flexibility, gap[..., None])[..., 0]
            size = np.ones(len(l0))
            for _ in range(12):
                trial = ends + size[:, None] * step
                found, new = self._rotations(trial.reshape(-1, 2, 2), l0)
                worse = np.abs(theta - found).max(axis=1) / scale > np.maximum(off * (1.0 - 1e-4 * size), _TOLERANCE)
                if not worse.any():
                    break
                size = np.where(worse, 0.5 * size, size)
            ends, flexibility, gap = trial, new, theta - found
            if np.all(np.abs(step).max(axis=1) <= 1e-15 * (np.abs(ends).max(axis=1) + 1e-300)):
                break
        return ends, np.linalg.inv(flexibility)

    def utilisation(self, force):
        """Largest bending moment of each element relative to its collapse moment (e,), from section forces (e,6)."""
        return largest_moments(force) / self.bending.collapse

    @property
    def criteria(self):
        """See Section."""
        return TUBE_CRITERIA

    def judged(self, force, natural, l0):
        """See Section."""
        return judged_tubes(self, force, natural, l0)


def largest_moments(force):
    """The larger bending moment N m (e,) of both ends of each element, from section forces (e,6)."""
    m = force[:, 1:5].reshape(-1, 2, 2)
    return np.sqrt(np.einsum("eik,eik->ei", m, m)).max(axis=1)


def judged_tubes(section, force, natural, l0):
    """Values (e,) of the TUBE_CRITERIA from section forces and natural deformations (e,6).

    The strain is that of the fabric far from the axis, |N| / EA + kappa r, with kappa of the larger end by the initial
    stiffness up to collapse, so a lower bound where the tube softens.
    """
    bend = np.linalg.norm(natural[:, 3:5] - natural[:, 1:3], axis=1) / l0
    strain = np.abs(force[:, 0]) / section.EA + bend * section.radius
    values = largest_moments(force) / section.wrinkling, section.utilisation(force), strain
    return dict(zip((c.name for c in TUBE_CRITERIA), values, strict=True))


def wrinkling_moment(pressure, radius):
    """Moment N m at which bending begins to wrinkle a tube, p pi r^3 / 2 (Comer and Levy 1963)."""
    return 0.5 * np.pi * pressure * radius**3


# Constants of Breukels (2011), "An engineering methodology for kite design", as in the LEI thesis, table 5.1: pressure
# in bar, radius and deflection in m, angles in rad, beam of 1 m. C19 is 0.0918; the thesis prints 918.
BENDING = (6582.82, -272.43, 40852.38, 14.31, 271865251.42, 215.93, 14021.79, -589.05)
COLLAPSE = (322.55, 0.0239, 5.3833, 0.0461)
TORSION = (1467.0, 40.908, -191.8, 47.406, -17703.0, 358.05, 0.0918)
# Least radius m to which the fits are taken. EI / r^3, the modulus of the fabric, is steady above it and falls to zero
# at about 0.04 m, where the fits are extrapolated into nonsense. Thinner tubes are scaled from this radius as
# thin-walled tubes of one fabric and pressure scale: stiffnesses and moments with r^3, curvature at collapse with 1.
LEAST_RADIUS = 0.06
# Part of the initial stiffness to which the law is followed where the fits' own collapse comes later (large radii).
LEAST_LEFT = 0.005
BAR = 1e5  # Pa
# A real cantilever of 1 m under a dead tip load bends its own lever: at a tip deflection v (m) the arm of the root is
# shorter by ARM v^2, and v itself is the linear deflection less SINE v^3. For a linear beam that is 3/5 and 3/7 (with
# them w / L = a / 3 - 4 a^3 / 105 of the elastica is met), for one that bends at its root only 1/2 and 1/6; a tube goes
# from the first towards the second as it softens, so the means are taken. Within 1.3 % of the fits up to collapse.
ARM, SINE = 0.55, 0.3


@dataclass(frozen=True, eq=False)
class BreukelsBending(Section):
    """Curvature over moment from tip load P = A (1 - exp(-B v / A)) over deflection v, cantilever of 1 m, arrays (e,).

    With the moment M = P s at s from the tip, v_b(P) = int_0^1 kappa(P s) s ds gives kappa(M) = 2 v_b + M dv_b/dM at
    P = M / (1 m), v_b the bending part of the deflection. Both are corrected for the size of v (see ARM):
    M = P (1 - ARM v^2) and v_b = v (1 + SINE v^2) - M / kGA.
    """

    A: np.ndarray  # N
    B: np.ndarray  # N/m
    kGA: np.ndarray  # N
    collapse: np.ndarray  # N m
    scale: np.ndarray  # moments over those of the fitted radius

    def bend(self, moment):
        """See BendingLaw."""
        a, b, kga, scale = (v[:, None] for v in (self.A, self.B, self.kGA, self.scale))
        m = moment / scale
        v = -a / b * np.log1p(-m / a)
        for _ in range(12):  # from below on a concave function: every step gains, the last ones quadratically
            value, m1, m2 = _root_moment(v, a, b)
            step = (m - value) / m1
            v = v + step
            if np.all(np.abs(step) <= 1e-9 * v):  # the next one would be below rounding
                break
        _, m1, m2 = _root_moment(v, a, b)
        bent = v * (1.0 + SINE * v * v) - m / kga
        bent1 = 1.0 + 3.0 * SINE * v * v - m1 / kga
        bent2 = 6.0 * SINE * v - m2 / kga
        return 2.0 * bent + m * bent1 / m1, (3.0 * bent1 + m * (bent2 - bent1 * m2 / m1) / m1) / (m1 * scale)


def _root_moment(v, a, b):
    """Moment N m at the root of a cantilever of 1 m with the tip deflection v, and its two derivatives."""
    decay = np.exp(-b * v / a)
    p, p1, p2 = a * (1.0 - decay), b * decay, -b * b / a * decay
    arm, arm1, arm2 = 1.0 - ARM * v * v, -2.0 * ARM * v, -2.0 * ARM
    return p * arm, p1 * arm + p * arm1, p2 * arm + 2.0 * p1 * arm1 + p * arm2


def _collapse_moment(a, b, deflection):
    """Moment at the collapse deflection, or where the tangent stiffness falls to LEAST_LEFT if that comes first."""
    low, high = np.zeros_like(a), np.asarray(deflection, float).copy()
    soft = _root_moment(high, a, b)[1] < LEAST_LEFT * b
    for _ in range(60):
        middle = 0.5 * (low + high)
        stiff = _root_moment(middle, a, b)[1] >= LEAST_LEFT * b
        low, high = np.where(soft & stiff, middle, low), np.where(soft & ~stiff, middle, high)
    return _root_moment(np.where(soft, low, deflection), a, b)[0]


@cache
def _wrinkled():
    """Curvature over moment of a pressurised membrane tube, both relative to the onset of wrinkles (Comer and Levy).

    With theta_0 the half angle of the wrinkled part: kappa / kappa_w = pi / D, D = (pi - theta_0) cos theta_0 +
    sin theta_0, and M / M_w = (pi - theta_0 + sin(2 theta_0) / 2) / D.
    """
    from scipy.interpolate import CubicSpline  # not loaded where no fabric wrinkles

    theta = np.linspace(0.0, 2.9, 400)
    d = (np.pi - theta) * np.cos(theta) + np.sin(theta)
    moment = (np.pi - theta + 0.5 * np.sin(2.0 * theta)) / d
    return CubicSpline(moment, np.pi / d, bc_type=((1, 1.0), "not-a-knot"))


# Collapse of a membrane tube, relative to the onset of wrinkles: the moment tends to 2 and the curvature to infinity;
# here nine tenths of the circumference are wrinkled.
FULLY_WRINKLED = 1.98


@dataclass(frozen=True, eq=False)
class WrinklingBending(Section):
    """Curvature over moment of a membrane tube, linear with EI up to the `onset` of wrinkles, arrays (e,)."""

    EI: np.ndarray  # N m^2
    onset: np.ndarray  # N m
    collapse: np.ndarray  # N m

    def bend(self, moment):
        """See BendingLaw."""
        ei, onset = self.EI[:, None], self.onset[:, None]
        relative = moment / onset
        beyond = np.maximum(relative, 1.0)
        kappa = np.where(relative <= 1.0, relative, _wrinkled()(beyond))
        slope = np.where(relative <= 1.0, 1.0, _wrinkled()(beyond, 1))
        return kappa * onset / ei, slope / ei


def tip_load(pressure, radius, deflection):
    """Tip load N of a cantilever of 1 m at its tip deflection m: P = A (1 - exp(-B v / A)) (LEI thesis eq. 5.24)."""
    a, b = _bending_constants(pressure / BAR, radius)
    return a * (1.0 - np.exp(-b * deflection / a))


def torque(pressure, radius, angle):
    """Torque N m that twists a tube of 1 m by an angle rad: T = peak atan(rate phi) (LEI thesis eq. 5.25)."""
    peak, rate = _torsion_constants(pressure / BAR, radius)
    return peak * np.arctan(rate * angle)


def collapse_deflection(pressure, radius):
    """Tip deflection m at which a cantilever of 1 m collapses."""
    c9, c10, c11, c12 = COLLAPSE
    return (c9 * radius**4 + c10) * pressure / BAR + c11 * radius**2 + c12


def _bending_constants(p, r):
    c1, c2, c3, c4, c5, c6, c7, c8 = BENDING
    return (c1 * r + c2) * p**2 + c3 * r**3 + c4, (c5 * r**5 + c6) * p + c7 * r + c8


def _torsion_constants(p, r):
    c13, c14, c15, c16, c17, c18, c19 = TORSION
    return (c13 * r + c14) * p + c15 * r + c16, c17 * r**4 * np.log(p) + c18 * r**3 + c19


def breukels_tube(pressure, radius):
    """Sections of tubes at `pressure` Pa with radii (e,) m after the fits of Breukels; see LEAST_RADIUS.

    The shear stiffness is that of the fabric, which torsion measures (GJ = 2 pi r^3 Gt, kGA = pi r Gt = GJ / 2 r^2),
    and the pressure's p pi r^2 (Fichter 1966); EA = 2 EI / r^2, as for any thin-walled tube. ValueError in one sentence
    for a pressure or a radius that is not above zero, or where the fits give no stiffness.
    """
    radius = np.asarray(radius, float)
    pressure = np.broadcast_to(np.asarray(pressure, float), radius.shape)
    _check_tubes(pressure, radius)
    r = np.maximum(radius, LEAST_RADIUS)
    scale = (radius / r) ** 3
    p = pressure / BAR
    a, b = _bending_constants(p, r)
    peak, rate = _torsion_constants(p, r)
    if np.any(a <= 0.0) or np.any(b <= 0.0) or np.any(peak <= 0.0) or np.any(rate <= 0.0):
        worst = float(pressure[int(np.argmin(np.minimum(np.minimum(a, b), np.minimum(peak, rate))))])
        raise ValueError(f"the fits of inflated tubes give no stiffness at {worst:g} Pa; choose another pressure.")
    kga = peak * rate / (2.0 * r * r) + pressure * np.pi * r * r
    collapse = _collapse_moment(a, b, collapse_deflection(pressure, r))
    bending = BreukelsBending(a, b, kga, scale * collapse, scale)
    ei = scale / (3.0 * (1.0 / b - 1.0 / kga))
    own_kga = scale * peak * rate / (2.0 * radius * radius) + pressure * np.pi * radius * radius
    ea, wrinkling = 2.0 * ei / radius**2, wrinkling_moment(pressure, radius)
    return TubeSection(ea, own_kga, scale * peak, rate, bending, radius, wrinkling)


def inflatable_tube(pressure, radius, tension, shear):
    """Sections of tubes from the fabric: membrane stiffness `tension` E t and `shear` G t N/m, arrays or numbers.

    EI = (E t + p r / 2) pi r^3, kGA = p pi r^2 + G t pi r, GJ = 2 pi r^3 G t, EA = 2 pi r E t (Le van and Wielgosz
    2005, the pressure's force over the section added to E as they do); wrinkles begin at p pi r^3 / 2 and the moment
    tends to twice that (Comer and Levy 1963). ValueError in one sentence for a value that is not above zero.
    """
    radius = np.asarray(radius, float)
    pressure, tension, shear = (np.broadcast_to(np.asarray(v, float), radius.shape) for v in (pressure, tension, shear))
    _check_tubes(pressure, radius)
    if np.any(tension <= 0.0) or np.any(shear <= 0.0):
        raise ValueError("the stiffnesses E t and G t of a tube's fabric must be above zero N/m.")
    onset = wrinkling_moment(pressure, radius)
    ei = (tension + 0.5 * pressure * radius) * np.pi * radius**3
    kga = pressure * np.pi * radius**2 + shear * np.pi * radius
    # torsion of the fabric stays linear: an arctangent with a rate so small that it never turns
    rate = np.full(radius.shape, 1e-6)
    bending = WrinklingBending(ei, onset, FULLY_WRINKLED * onset)
    peak = 2.0 * np.pi * radius**3 * shear / rate
    return TubeSection(2.0 * np.pi * radius * tension, kga, peak, rate, bending, radius, onset)


def _check_tubes(pressure, radius):
    if not np.all(np.isfinite(radius)) or np.any(radius <= 0.0):
        raise ValueError("the diameter of an inflated tube must be above zero.")
    if not np.all(np.isfinite(pressure)) or np.any(pressure <= 0.0):
        raise ValueError("the pressure of an inflated tube must be above zero.")
