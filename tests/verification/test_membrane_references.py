"""References of membranes: series, shooting and closed forms, each against another derivation or published figures."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar, root

from benchmarks import particle_membrane
from benchmarks.membrane_references import (
    COLLAPSE,
    FIRST_WRINKLE,
    STRIP_COLLAPSE,
    STRIP_WRINKLE,
    TERMS,
    axisymmetric_membrane,
    cylinder_stretches,
    hencky_series,
    shear_panel,
    sphere_stretch,
    strip_of_curvature,
    strip_of_moment,
    tube_of_curvature,
    tube_of_moment,
    tube_of_slack,
)
from structural import inflatable_tube

SMALL, LARGE = 0.0046, 0.0457  # q = p a / (E h) of the particle system thesis and of its table B.2
RADIUS = particle_membrane.RADIUS


@pytest.mark.parametrize(
    ("nu", "b0"), [(0.0, 1.6204), (0.1, 1.6487), (0.2, 1.6827), (0.3, 1.7244), (0.34, 1.7439), (0.4, 1.7769)]
)
def test_hencky_constant_is_that_of_the_published_table(nu, b0):
    assert hencky_series(nu).b0 == pytest.approx(b0, abs=6e-5)  # the digits of table B.1


def test_terms_of_the_series_are_the_published_fractions():
    """The recurrence in fractions, for a centre of 4 n = 1, against the terms of Hencky and Fichter."""
    n, m = [Fraction(1, 4)], [Fraction(4)]
    for k in range(1, len(particle_membrane.A)):
        n.append(-sum(m[i] * m[k - 1 - i] for i in range(k)) / (32 * k * (k + 1)))
        m.append(-sum(n[i] * m[k - i] for i in range(1, k + 1)) / n[0])
    radial = [-4 * float(v) for v in n[1:]]
    assert radial == pytest.approx(particle_membrane.B[: len(radial)], rel=1e-15)
    slope = [float(v) / (4 * (k + 1)) for k, v in enumerate(m)]
    assert slope == pytest.approx(particle_membrane.A, rel=1e-15)
    for nu in (0.0, 0.4):  # and the same in floating point, with b0 to its power
        found = hencky_series(nu)
        scaled = [-v / found.b0 ** (3 * k + 2) for k, v in enumerate(particle_membrane.B)]
        assert 4.0 * found.radial_terms[1 : len(scaled) + 1] == pytest.approx(scaled, rel=1e-13)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4])
def test_series_balances_pressure_and_strains_of_the_disc(nu):
    found, q = hencky_series(nu), 0.01
    assert abs(found.radial_terms[-1]) < 1e-25 * found.radial_terms[0]
    assert len(found.radial_terms) == TERMS
    step = 1e-5
    for c in (0.1, 0.5, 0.9):
        slope = (found.deflection(q, c + step) - found.deflection(q, c - step)) / (2 * step)
        assert found.radial(q, c) * slope == pytest.approx(-0.5 * q * c, rel=1e-8)  # of the step, squared
        # the hoop strain is u / c and the radial one u' + w'^2 / 2
        hoop = [found.hoop(q, x) - nu * found.radial(q, x) for x in (c - step, c, c + step)]
        moved = ((c + step) * hoop[2] - (c - step) * hoop[0]) / (2 * step)
        strain = found.radial(q, c) - nu * found.hoop(q, c)
        assert moved + 0.5 * slope**2 == pytest.approx(strain, rel=1e-7)
    assert found.hoop(q, 1.0) == pytest.approx(nu * found.radial(q, 1.0), abs=1e-15)  # the edge does not move
    assert found.hoop(q) == found.radial(q)


def test_series_gives_the_published_deflections():
    assert RADIUS * hencky_series(0.0).deflection(SMALL) == pytest.approx(0.0170, abs=5e-5)  # their digits
    assert RADIUS * hencky_series(0.34).deflection(LARGE) == pytest.approx(0.0328, abs=5e-5)


def ritz(q, nu, count=12):
    """Deflection over a, and radial S over E h at the centre and the edge, of the same disc by polynomials.

    r = R + (1 - R^2) R P(R^2) and z = (1 - R^2) Q(R^2) make its energy stationary; no equilibrium is written down.
    """
    x, w = np.polynomial.legendre.leggauss(60)
    radius, w = 0.5 * (1.0 + x), 0.5 * w
    square = radius**2
    legendre = np.polynomial.legendre.Legendre.basis
    basis = [legendre(k)(2.0 * square - 1.0) for k in range(count)]
    slope = [legendre(k).deriv()(2.0 * square - 1.0) * 4.0 * radius for k in range(count)]
    lift = np.array([(1 - square) * b for b in basis])
    lift1 = np.array([-2 * radius * b + (1 - square) * s for b, s in zip(basis, slope, strict=True)])
    out, out1 = radius * lift, lift + radius * lift1

    def stresses(c):
        r, r1 = radius + c[:count] @ out, 1.0 + c[:count] @ out1
        z1 = c[count:] @ lift1
        e1, e2 = 0.5 * (r1**2 + z1**2 - 1.0), 0.5 * ((r / radius) ** 2 - 1.0)
        return r, r1, z1, (e1 + nu * e2) / (1 - nu**2), (e2 + nu * e1) / (1 - nu**2)

    def gradient(c):
        r, r1, z1, s1, s2 = stresses(c)
        outward = (out1 * (s1 * r1 * radius) + out * (s2 * r / radius + q * r * z1)) @ w
        upward = (lift1 * (s1 * z1 * radius + 0.5 * q * r**2)) @ w
        return np.concatenate([outward, upward])

    start = np.zeros(2 * count)
    start[count] = hencky_series(nu).deflection(q)
    found = root(gradient, start, tol=1e-14)
    assert np.abs(gradient(found.x)).max() < 1e-13
    ends = [legendre(k)(np.array([-1.0, 1.0])) for k in range(count)]
    height = sum(c * e[0] for c, e in zip(found.x[count:], ends, strict=True))
    # at the edge r' and z' are 1 - 2 P(1) and -2 Q(1), and r = R
    r1 = 1.0 - 2.0 * sum(c * e[1] for c, e in zip(found.x[:count], ends, strict=True))
    z1 = -2.0 * sum(c * e[1] for c, e in zip(found.x[count:], ends, strict=True))
    stretch = 1.0 + sum(c * e[0] for c, e in zip(found.x[:count], ends, strict=True))
    return height, 0.5 * (stretch**2 - 1.0) / (1.0 - nu), 0.5 * (r1**2 + z1**2 - 1.0) / (1.0 - nu**2)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4])
@pytest.mark.parametrize("q", [SMALL, LARGE])
def test_shooting_and_ritz_agree_on_the_disc_under_pressure(q, nu):
    found = axisymmetric_membrane(q, nu)
    height, centre, edge = ritz(q, nu)
    assert found.deflection == pytest.approx(height, rel=1e-8)  # the polynomials converge to 1e-9 with 12 terms
    assert found.centre == pytest.approx(centre, rel=1e-7)
    assert found.edge_radial == pytest.approx(edge, rel=1e-6)  # stress at the end of an interval: worst of polynomials
    assert found.edge_hoop == pytest.approx(nu * found.edge_radial, abs=1e-12)  # the edge does not move


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4])
def test_shooting_comes_to_the_series_as_the_load_falls(nu):
    """Both leave out what the other has in the square of the slope, that is q^(2/3)."""
    series = hencky_series(nu)
    loads = (1e-3, 1e-4)
    off = [axisymmetric_membrane(q, nu).deflection / series.deflection(q) - 1.0 for q in loads]
    assert off[0] / off[1] == pytest.approx(10.0 ** (2.0 / 3.0), rel=0.02)  # of next order, the slope itself squared
    assert off[1] < 3e-4


def test_series_and_model_differ_as_published():
    """By 0.2 to 0.35 % at the small load and 1.0 to 1.6 % at the large one, for Poisson's ratios from 0.4 to 0."""
    for q, low, high in ((SMALL, 0.0020, 0.0036), (LARGE, 0.010, 0.0163)):
        off = [
            axisymmetric_membrane(q, nu).deflection / hencky_series(nu).deflection(q) - 1.0 for nu in (0.4, 0.3, 0.0)
        ]
        assert off == sorted(off)
        assert low < off[0]
        assert off[-1] < high


def test_model_is_within_a_half_percent_of_a_published_membrane_code():
    """mem4py: 33.26 mm at the large load, nu = 0.34, with 844 triangles of constant strain."""
    assert RADIUS * axisymmetric_membrane(LARGE, 0.34).deflection == pytest.approx(0.03326, rel=5e-3)


def test_stress_per_current_length_carries_the_pressure_at_the_edge():
    """2 pi a N sin(slope) = p pi a^2 with the slope of the deformed meridian."""
    found = axisymmetric_membrane(LARGE, 0.3)
    _, r, z = found.profile
    meridian = np.polynomial.Polynomial.fit(r[-6:], z[-6:], 5).deriv()
    slope = np.arctan(-meridian(1.0))
    assert found.true_edge_radial * np.sin(slope) == pytest.approx(0.5 * LARGE, rel=1e-5)  # of the polynomial
    assert found.true_centre == found.centre  # equal stretches cancel


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
@pytest.mark.parametrize("q", [1e-3, 0.1, 1.0])
def test_spheres_and_cylinders_minimise_their_energy(q, nu):
    """Energy of the fabric less pressure times volume, per area and over E h, has no slope at the stretches given."""

    def fabric(one, two):
        e1, e2 = 0.5 * (one**2 - 1.0), 0.5 * (two**2 - 1.0)
        return 0.5 * (e1 * e1 + e2 * e2 + 2.0 * nu * e1 * e2) / (1.0 - nu**2)

    sphere = minimize_scalar(lambda l: fabric(l, l) - q * l**3 / 3.0, bracket=(1.0, 1.0 + q))
    # minima are found to the root of rounding, of an energy that has the slope q
    assert sphere_stretch(q, nu) == pytest.approx(sphere.x, abs=1e-7)
    around, along = cylinder_stretches(q, nu)
    step = 1e-5
    for turn in ((step, 0.0), (0.0, step)):
        up, down = (
            fabric(around + k * turn[0], along + k * turn[1])
            - 0.5 * q * (around + k * turn[0]) ** 2 * (along + k * turn[1])
            for k in (1.0, -1.0)
        )
        assert (up - down) / (2.0 * step) == pytest.approx(0.0, abs=1e-9)
    held = minimize_scalar(lambda l: fabric(l, 1.0) - 0.5 * q * l**2, bracket=(1.0, 1.0 + q))
    assert cylinder_stretches(q, nu, "held") == pytest.approx((held.x, 1.0), abs=1e-7)


def test_small_pressures_give_the_strains_of_thin_walls():
    q, nu = 1e-6, 0.3
    around, along = cylinder_stretches(q, nu)
    assert around - 1.0 == pytest.approx(q * (1.0 - 0.5 * nu), rel=1e-5)
    assert along - 1.0 == pytest.approx(q * (0.5 - nu), rel=1e-5)
    assert sphere_stretch(q, nu) - 1.0 == pytest.approx(0.5 * q * (1.0 - nu), rel=1e-5)
    with pytest.raises(ValueError, match="ends of a cylinder are 'caps' or 'held', not 'open'"):
        cylinder_stretches(q, nu, "open")


@pytest.mark.parametrize("slack", [0.0, 0.5, 1.5, 2.5])
def test_tension_of_a_wrinkled_tube_carries_pressure_and_moment(slack):
    """Axial resultants p r curvature (cos t0 - cos t), none within t0 of the inner side."""
    tube = tube_of_slack(slack)

    def tension(t):
        return tube.curvature * (np.cos(slack) - np.cos(t))

    force = 2.0 * quad(tension, slack, np.pi)[0]
    moment = 2.0 * quad(lambda t: -tension(t) * np.cos(t), slack, np.pi)[0]
    assert force == pytest.approx(np.pi, rel=1e-12)  # p pi r^2 over p r^2
    assert moment == pytest.approx(tube.moment, rel=1e-12)
    assert tube.tension == pytest.approx(tension(np.pi), rel=1e-14)


def test_tubes_wrinkle_at_half_the_moment_of_their_collapse():
    first = tube_of_slack(0.0)
    assert (first.moment, first.curvature, first.tension) == pytest.approx((0.5 * np.pi, 0.5, 1.0), rel=1e-15)
    assert pytest.approx(0.5 * COLLAPSE, rel=1e-15) == FIRST_WRINKLE
    assert tube_of_slack(np.pi - 0.01).moment == pytest.approx(COLLAPSE, rel=1e-4)  # of the angle squared
    assert tube_of_curvature(1e5).moment < COLLAPSE
    with pytest.raises(ValueError, match=r"a tube collapses at pi p r\^3"):
        tube_of_moment(COLLAPSE)


@pytest.mark.parametrize("moment", [0.1, 1.5, 1.6, 2.0, 2.5, 3.0])
def test_curvature_and_moment_of_a_tube_belong_to_each_other(moment):
    tube = tube_of_moment(moment)
    assert tube.moment == pytest.approx(moment, rel=1e-12)
    assert tube_of_curvature(tube.curvature).moment == pytest.approx(moment, rel=1e-12)


@pytest.mark.parametrize("moment", [1.0, 1.8, 2.4, 3.0])
def test_tube_beams_of_fabric_have_the_moment_and_curvature_of_membranes(moment):
    pressure, radius, fabric = 3e4, 0.1, 2e5
    law = inflatable_tube(pressure, np.array([radius]), fabric, 4e4).bending
    curvature = law.bend(np.array([[moment * pressure * radius**3]]))[0][0, 0]
    # they add half the pressure's force to the stiffness of the fabric (Le van and Wielgosz 2005)
    stiffness = fabric + 0.5 * pressure * radius
    assert curvature * stiffness / pressure == pytest.approx(tube_of_moment(moment).curvature, rel=1e-6)  # its spline


@pytest.mark.parametrize("moment", [0.05, 1 / 6, 0.25, 0.4, 0.49])
def test_stress_of_a_wrinkled_strip_carries_tension_and_moment(moment):
    """Stress over that of P alone rises with the slope kappa from the slack band, or from one edge, to the other."""
    strip = strip_of_moment(moment)

    def stress(y):
        return strip.stress + strip.curvature * (y - 0.5)

    low = strip.slack - 0.5  # of y = -1/2 ... 1/2 over H
    assert quad(stress, low, 0.5)[0] == pytest.approx(1.0, rel=1e-12)
    assert quad(lambda y: stress(y) * y, low, 0.5)[0] == pytest.approx(moment, rel=1e-12)
    assert stress(low) >= -1e-14
    assert stress(low) == pytest.approx(0.0, abs=1e-12) or strip.slack == 0.0
    assert strip_of_curvature(strip.curvature).moment == pytest.approx(moment, rel=1e-12)


def test_strips_wrinkle_at_a_sixth_and_collapse_at_a_half():
    assert strip_of_moment(STRIP_WRINKLE).slack == 0.0
    assert strip_of_moment(STRIP_WRINKLE * (1.0 + 1e-9)).curvature == pytest.approx(2.0, rel=1e-8)
    assert strip_of_curvature(1e6).moment == pytest.approx(STRIP_COLLAPSE, rel=1e-3)
    with pytest.raises(ValueError, match=r"a strip collapses at P H / 2; it carries no moment of 0\.5 P H"):
        strip_of_moment(0.5)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
def test_a_panel_in_a_tension_field_has_a_quarter_of_youngs_modulus_in_shear(nu):
    """Its energy is that of the strain plus the wrinkle strain e n n that makes it least, over angle and e >= 0."""
    gamma = 1e-3

    def energy(size, angle):
        c, s = np.cos(angle), np.sin(angle)
        e11, e22, e12 = size * c * c, size * s * s, 0.5 * gamma + size * c * s
        return 0.5 / (1.0 - nu**2) * (e11**2 + e22**2 + 2.0 * nu * e11 * e22 + 2.0 * (1.0 - nu) * e12**2)

    angles = np.linspace(0.0, np.pi, 181)  # a degree, and 135 among them
    sizes = np.linspace(0.0, gamma, 2001)
    least = energy(*np.meshgrid(sizes, angles, indexing="ij"))
    k, j = np.unravel_index(np.argmin(least), least.shape)
    stress, principal, wrinkles = shear_panel(gamma)
    # the grid of e leaves the square of half its step
    assert least[k, j] == pytest.approx(0.5 * stress * gamma, rel=1e-5)
    assert principal == pytest.approx(2.0 * stress, rel=1e-15)
    assert angles[j] - 0.5 * np.pi == pytest.approx(wrinkles, abs=1e-12)  # wrinkles run across the shortening
