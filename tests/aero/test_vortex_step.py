"""Loads of whole wings: what rotation, scaling, mirror images and strip theory must leave alone."""

import numpy as np
import pytest

from aero.vortex_step.strips import control_fractions, strips_between
from tests.aero.wings import arched_nodes, linear_wing, nodes_of, rotation, stalling_wing, wind

AXES = {"y": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0], "skew": [0.3, -0.8, 0.5]}
MODES = [{"direction": "bound"}, {"direction": "control"}, {"induction": False}, {"section_force": "normal"}]


def flat_nodes(strips, span, chord):
    y = np.linspace(-0.5 * span, 0.5 * span, strips + 1)
    edge = np.stack([0.0 * y, y, 0.0 * y], axis=1)
    return nodes_of(edge, edge + np.array([chord, 0.0, 0.0]))


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("mode", MODES)
def test_loads_turn_with_wing_and_wind_turned_30_degrees_together(axis, mode):
    r = rotation(AXES[axis], np.deg2rad(30.0))
    wing, nodes, v = stalling_wing(9, **mode), arched_nodes(9, 0.04, np.random.default_rng(5)), wind(0.06)
    a, b = wing.loads(nodes, v), wing.loads(nodes @ r.T + [3.0, -7.0, 2.0], r @ v)
    assert a.circulation.converged
    # each is solved to 1e-12 of U c / 2 = 12 m^2/s; the Jacobian and q c multiply that by less than 1e4
    np.testing.assert_allclose(b.circulation.gamma, a.circulation.gamma, rtol=0, atol=1e-9)
    np.testing.assert_allclose(b.force, a.force @ r.T, rtol=0, atol=1e-8)
    np.testing.assert_allclose(b.moment, a.moment @ r.T, rtol=0, atol=1e-8)
    np.testing.assert_allclose(b.pressure, a.pressure, rtol=0, atol=1e-8)
    if a.shear is not None:
        np.testing.assert_allclose(b.shear, a.shear @ r.T, rtol=0, atol=1e-8)


@pytest.mark.parametrize("mode", MODES)
def test_loads_grow_with_density_and_with_the_square_of_the_speed(mode):
    wing, nodes = stalling_wing(9, **mode), arched_nodes(9)
    a = wing.loads(nodes, wind(0.06, 7.0))
    b = wing.in_air(3.0 * wing.density).loads(nodes, wind(0.06, 14.0))
    # the circulation scales with the speed and the angles stay; solved to 1e-12, multiplied by less than 1e3
    np.testing.assert_allclose(b.circulation.gamma, 2.0 * a.circulation.gamma, rtol=1e-9)
    np.testing.assert_allclose(b.circulation.alpha, a.circulation.alpha, rtol=0, atol=1e-10)
    np.testing.assert_allclose(b.force, 12.0 * a.force, rtol=0, atol=1e-9 * np.abs(b.force).max())
    np.testing.assert_allclose(b.pressure, 12.0 * a.pressure, rtol=0, atol=1e-9 * np.abs(b.pressure).max())


def test_a_wing_twice_as_large_has_four_times_the_force_and_eight_times_the_moment():
    wing, nodes = stalling_wing(9), arched_nodes(9)
    a, b = wing.loads(nodes, wind(0.06)), wing.loads(2.0 * nodes, wind(0.06))
    zero = np.zeros(3)
    np.testing.assert_allclose(b.total_force(), 4.0 * a.total_force(), rtol=0, atol=1e-7)  # N of 1e3, solved to 1e-12
    np.testing.assert_allclose(b.total_moment(zero), 8.0 * a.total_moment(zero), rtol=0, atol=1e-6)
    np.testing.assert_allclose(b.pressure, a.pressure, rtol=0, atol=1e-7)


def test_the_mirror_image_of_an_asymmetric_wing_has_the_mirror_image_of_its_loads():
    flip = np.array([1.0, -1.0, 1.0])
    nodes = arched_nodes(9, 0.05, np.random.default_rng(2))
    image = nodes.reshape(-1, 3, 3)[::-1].reshape(-1, 3) * flip
    wing = stalling_wing(9)
    v = np.array([11.0, 1.5, 1.0])
    a, b = wing.loads(nodes, v), wing.loads(image, v * flip)
    np.testing.assert_allclose(b.force[::-1] * flip, a.force, rtol=0, atol=1e-8)  # N of 100, solved to 1e-12
    np.testing.assert_allclose(b.moment[::-1] * flip * [-1, -1, -1], a.moment, rtol=0, atol=1e-8)  # axial vector


@pytest.mark.parametrize("alpha", [-0.05, 0.0, 0.08])
def test_a_rectangular_wing_in_strip_theory_has_the_lift_drag_and_moment_of_its_section(alpha):
    wing = linear_wing(7, slope=5.0, cl0=0.2, cd=0.02, cm=-0.07, induction=False)
    span, chord = 6.0, 1.5
    loads = wing.loads(flat_nodes(7, span, chord), wind(alpha, 10.0))
    q_area = 0.5 * 1.225 * 100.0 * span * chord
    along = wind(alpha, 1.0)
    up = np.array([-along[2], 0.0, along[0]])
    # rounding
    assert loads.total_force() @ up / q_area == pytest.approx(0.2 + 5.0 * alpha, rel=1e-12)
    assert loads.total_force() @ along / q_area == pytest.approx(0.02, rel=1e-11)
    about = np.array([0.25 * chord, 0.0, 0.0])
    np.testing.assert_allclose(loads.total_moment(about) / (q_area * chord), [0.0, -0.07, 0.0], rtol=0, atol=1e-13)


def test_sweep_in_strip_theory_follows_the_cosine_rule():
    """An infinite wing swept by L lifts with the flow normal to its span: C_L = 2 pi alpha cos L at small angles."""
    chord, alpha = 1.0, 1e-4
    for sweep in (0.0, 0.3, 0.6):
        y = np.linspace(-3.0, 3.0, 7)
        edge = np.stack([np.tan(sweep) * y, y, 0.0 * y], axis=1)
        loads = linear_wing(6, induction=False).loads(
            nodes_of(edge, edge + np.array([chord, 0.0, 0.0])), wind(alpha, 10.0)
        )
        lift = loads.total_force()[2] / (0.5 * 1.225 * 100.0 * 6.0 * chord)
        assert lift == pytest.approx(2.0 * np.pi * alpha * np.cos(sweep), rel=1e-6)  # next order alpha^2


def test_strips_in_reverse_order_turn_the_suction_side_around():
    """The order along the span says which side is suction: right to left is the same wing flying upside down."""
    nodes = arched_nodes(8)
    sections = nodes.reshape(-1, 3, 3)
    forward = strips_between(sections[:, 0], sections[:, 2])
    back = strips_between(sections[::-1, 0], sections[::-1, 2])
    np.testing.assert_allclose(back.normal[::-1], -forward.normal, atol=1e-14)  # rounding
    assert np.all(forward.normal[:, 2] > 0.0)  # left tip (y < 0) to right tip, x aft: suction up
    wing = stalling_wing(8)
    forth = wing.loads(nodes, wind(0.05)).circulation.alpha
    reverse = wing.loads(sections[::-1].reshape(-1, 3), wind(0.05)).circulation.alpha
    assert np.all(forth > 0.0)
    assert np.all(reverse < 0.0)


def test_control_points_lie_half_way_on_equal_strips_and_near_the_half_angle_on_cosine_ones():
    np.testing.assert_allclose(control_fractions(np.full(6, 0.3)), 0.5, rtol=1e-15)  # rounding
    tip, inner = [], []
    for n in (12, 24, 48):
        edges = -np.cos(np.linspace(0.0, np.pi, n + 1))
        exact = (-np.cos((np.arange(n) + 0.5) * np.pi / n) - edges[:-1]) / np.diff(edges)
        error = np.abs(control_fractions(np.diff(edges)) - exact)
        tip.append(error.max())
        inner.append(error[n // 4])
    # second-order or better inside; next to the tip (widths 1 : 3 : 5) van Garrel's weights give 13/32 for 5/12
    np.testing.assert_allclose(tip[-1], 5.0 / 12.0 - 13.0 / 32.0, rtol=0.01)  # (pi / 48)^2 = 0.004 from that limit
    assert inner[0] / inner[2] > 16.0  # (h / h')^2


def test_the_wake_takes_from_a_rectangular_wing_the_lift_that_lifting_line_theory_says():
    nodes = flat_nodes(12, 8.0, 1.0)
    lift = [linear_wing(12, induction=i).loads(nodes, wind(0.05)).total_force()[2] for i in (True, False)]
    # Prandtl's factor for aspect ratio 8 is 1 / (1 + 2 / 8) = 0.8 for an elliptic wing; a rectangular one is within 5 %
    assert lift[0] / lift[1] == pytest.approx(0.8, rel=0.05)


def test_no_wind_across_the_sections_means_no_force_from_them():
    """Wind along the span of a flat wing: no speed across, no load, and nothing undefined."""
    loads = linear_wing(6, induction=False).loads(flat_nodes(6, 6.0, 1.0), np.array([0.0, 10.0, 0.0]))
    assert np.abs(loads.force).max() == 0.0
