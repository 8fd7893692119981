"""Filament velocities against quadrature of the Biot-Savart law, and the limits of the core model."""

import numpy as np
import pytest
from scipy.integrate import quad

from aero.vortex_step.strips import strips_between
from aero.vortex_step.vortices import (
    control_influence,
    folded,
    infinite_velocity,
    segment_velocity,
    semi_infinite_velocity,
    trailing_influence,
)
from tests.aero.wings import arched_nodes, wind

POINTS = np.random.default_rng(0).uniform(-2.0, 2.0, (6, 3))
A, B = np.array([[0.3, -1.0, 0.2]]), np.array([[-0.4, 1.3, 0.9]])
D = np.array([2.0, 0.5, -1.0]) / np.linalg.norm([2.0, 0.5, -1.0])


def biot_savart(point, position, tangent, low, high):
    """int dl x r / (4 pi |r|^3) by adaptive quadrature, component by component."""

    def integrand(s, k):
        r = point - position(s)
        return np.cross(tangent, r)[k] / (4.0 * np.pi * np.linalg.norm(r) ** 3)

    return np.array([quad(integrand, low, high, args=(k,), epsabs=1e-12, epsrel=1e-11)[0] for k in range(3)])


def strips_of(n, noise=0.0, seed=0):
    nodes = arched_nodes(n, noise, np.random.default_rng(seed)).reshape(-1, 3, 3)
    return strips_between(nodes[:, 0], nodes[:, 2])


def test_a_segment_induces_its_biot_savart_integral():
    v = segment_velocity(POINTS, A, B, np.zeros(1))[:, :, 0].T
    for p, got in zip(POINTS, v, strict=True):
        exact = biot_savart(p, lambda s: A[0] + s * (B - A)[0], (B - A)[0], 0.0, 1.0)
        np.testing.assert_allclose(got, exact, rtol=0, atol=1e-10)  # the quadrature's own tolerance is 1e-11


def test_a_semi_infinite_filament_induces_its_biot_savart_integral():
    v = semi_infinite_velocity(POINTS, A, D, np.zeros(1))[:, :, 0].T
    for p, got in zip(POINTS, v, strict=True):
        exact = biot_savart(p, lambda s: A[0] + s * D, D, 0.0, np.inf)
        np.testing.assert_allclose(got, exact, rtol=0, atol=1e-9)  # quadrature over an infinite range: 1e-10


def test_two_semi_infinite_filaments_back_to_back_are_an_infinite_one_with_the_velocity_of_a_line_vortex():
    start = np.repeat(A, len(POINTS), axis=0)
    zero = np.zeros(len(POINTS))
    line = infinite_velocity(POINTS, start, np.repeat(D[None], len(POINTS), axis=0), zero).T
    halves = semi_infinite_velocity(POINTS, A, D, zero[:1]) - semi_infinite_velocity(POINTS, A, -D, zero[:1])
    np.testing.assert_allclose(halves[:, :, 0].T, line, rtol=0, atol=1e-14)  # rounding: velocities are of order 0.1
    r = POINTS - A
    h = np.linalg.norm(r - (r @ D)[:, None] * D, axis=1)
    np.testing.assert_allclose(np.linalg.norm(line, axis=1), 1.0 / (2.0 * np.pi * h), rtol=1e-13)  # rounding
    np.testing.assert_allclose(np.einsum("ij,ij->i", line, r), 0.0, atol=1e-14)  # turns about the line: rounding


def test_a_long_segment_tends_to_the_infinite_line():
    errors = []
    for half in (10.0, 100.0):
        v = segment_velocity(POINTS, A - half * D, A + half * D, np.zeros(1))[:, :, 0].T
        many = [np.repeat(x, len(POINTS), axis=0) for x in (A, D[None])]
        line = infinite_velocity(POINTS, *many, np.zeros(len(POINTS))).T
        errors.append(np.abs(v - line).max())
    # cos of the end angles is 1 - h^2 / 2 l^2: ten times longer is a hundred times closer (to 5 %: the next terms)
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.05)


@pytest.mark.parametrize("kind", ["segment", "semi-infinite", "infinite"])
def test_the_core_makes_velocity_fall_linearly_inside_and_leaves_it_alone_outside(kind):
    core = np.array([0.1])
    along, across = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])

    def speed(h, radius):
        p = (0.3 * along + h * across)[None]
        if kind == "segment":
            v = segment_velocity(p, -along[None], along[None], radius)
        elif kind == "semi-infinite":
            v = semi_infinite_velocity(p, np.zeros((1, 3)), along, radius)
        else:
            v = infinite_velocity(p, np.zeros((1, 3)), along[None], radius)
        return np.linalg.norm(v)

    zero = np.zeros(1)
    # h^2 / sqrt(h^4 + core^4): exactly 1 / sqrt 2 on the core radius
    assert speed(0.1, core) / speed(0.1, zero) == pytest.approx(np.sqrt(0.5), rel=1e-12)
    # far outside (core / h)^4 / 2 is missing, next term 1e-4 of that; deep inside h^2 / core^2, next (h / core)^4
    assert 1.0 - speed(1.0, core) / speed(1.0, zero) == pytest.approx(0.5e-4, rel=1e-3)
    assert speed(1e-4, core) == pytest.approx(speed(1e-4, zero) * 1e-8 / 1e-2, rel=1e-6)
    assert speed(0.0, core) == 0.0  # on the line itself


def test_a_horseshoe_less_its_two_dimensional_part_is_the_sum_of_its_quadratures():
    strips, wake = strips_of(5, noise=0.03), wind(0.1, 1.0)
    got = control_influence(strips, wake, core_fraction=0.0)
    for i in range(5):
        for j in (0, 2, 4):
            p, (a, b) = strips.control[i], strips.bound[[j, j + 1]]
            ta, tb = strips.trailing_edge[[j, j + 1]]
            v = biot_savart(p, lambda s, a=a, b=b: a + s * (b - a), b - a, 0.0, 1.0)
            for sign, start, end in ((-1.0, a, ta), (1.0, b, tb)):
                leg = biot_savart(p, lambda s, a=start, b=end: a + s * (b - a), end - start, 0.0, 1.0)
                far = biot_savart(p, lambda s, a=end: a + s * wake, wake, 0.0, np.inf)
                v = v + sign * (leg + far)
            if i == j:
                r = p - strips.centre[i]
                n = np.cross(strips.span[i], r)
                v = v - n / (2.0 * np.pi * (n @ n))
            np.testing.assert_allclose(got[:, i, j], v, rtol=0, atol=1e-8)  # five quadratures of about 1e-10 each


def test_the_divergence_free_wake_leaves_no_circulation_far_upstream():
    """A closed vortex (horseshoe) falls as 1 / distance^2 upstream: ten times farther is a hundred times less."""
    strips = strips_of(6)
    wake = np.array([1.0, 0.0, 0.0])
    far = [np.array([[-d, 0.4, 3.0]]) for d in (100.0, 1000.0)]

    def horseshoe(p):
        bound = segment_velocity(p, strips.bound[:-1], strips.bound[1:], np.zeros(6))
        return np.abs((bound + trailing_influence(p, strips, wake)).sum(axis=2)).max()

    # 10 %: the wing is 8 m wide at 100 m distance
    assert horseshoe(far[0]) / horseshoe(far[1]) == pytest.approx(100.0, rel=0.1)


@pytest.mark.parametrize("n", [8, 9])
def test_folded_influence_of_a_symmetric_wing_gives_the_velocities_of_the_full_one(n):
    strips, wake = strips_of(n), wind(0.15, 1.0)
    full = control_influence(strips, wake)
    half = slice(n // 2, n)
    gamma = np.random.default_rng(1).uniform(0.5, 2.0, n - n // 2)
    whole = np.concatenate([gamma[: (0 if n % 2 else None) : -1], gamma])
    mirror = np.arange(n)[::-1]
    got = folded(control_influence(strips, wake, half), mirror) @ gamma
    # rounding of sums of ten terms of order 1
    np.testing.assert_allclose(got, (full @ whole)[:, half], rtol=0, atol=1e-13)
