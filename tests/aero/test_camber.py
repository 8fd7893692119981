"""Feedback of camber: thin-airfoil theory for the billowing between leading and trailing edge."""

import numpy as np
import pytest

from tests.aero.wings import arched_nodes, grid, linear_wing, rotation, wind


def cambered(strips, rows, height, chord=2.0):
    """Nodes of a flat rectangular wing of 8 m span with the camber line z / c = 4 h x (1 - x)."""
    y = np.repeat(np.linspace(-4.0, 4.0, strips + 1), rows + 1)
    x = np.tile(np.linspace(0.0, 1.0, rows + 1), strips + 1)
    return np.stack([chord * x, y, chord * 4.0 * height * x * (1.0 - x)], axis=1)


def changes(rows, height):
    """Zero-lift angle and moment coefficient of a parabolic camber line of `rows` straight pieces."""
    g = grid(3, rows)
    zero_lift, moment = g.camber(cambered(3, rows, height)[g.sections], np.tile([0.0, 0.0, 1.0], (3, 1)))
    assert np.ptp(zero_lift) <= 1e-15
    assert np.ptp(moment) <= 1e-15
    return zero_lift[0], moment[0]


@pytest.mark.parametrize("height", [0.01, -0.04, 0.1])
def test_a_parabola_turns_the_zero_lift_angle_by_twice_its_height_and_the_moment_by_pi_times_it(height):
    off = np.array(
        [np.abs(np.divide(changes(k, height), (-2.0 * height, -np.pi * height)) - 1.0) for k in (5, 10, 20, 40)]
    )
    order = np.log2(off[:-1] / off[1:])
    # straight pieces between the stations: the error falls with the power 3/2 of their length, for the slope at the
    # edges goes with the root of the distance; the moment's is smaller
    assert np.all(order > 1.3)
    assert np.all(off[-1] < 0.01)


def test_camber_scales_with_its_height_and_not_with_the_chord_or_the_attitude():
    g = grid(3, 6)
    nodes = cambered(3, 6, 0.03)
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    plain = np.array(g.camber(nodes[g.sections], up))
    turn = rotation([1.0, -2.0, 0.5], 0.7)
    np.testing.assert_allclose(g.camber((3.0 * nodes @ turn.T)[g.sections], up @ turn.T), plain, rtol=0, atol=1e-14)
    np.testing.assert_allclose(g.camber(cambered(3, 6, -0.06)[g.sections], up), -2.0 * plain, rtol=0, atol=1e-14)


def test_a_cambered_wing_lifts_as_the_plane_one_at_an_angle_larger_by_the_shift():
    """With linear polars the shift of the zero-lift angle is one of incidence, to the second order of the angles."""
    rows, height = 12, 0.02
    zero_lift, moment = changes(rows, height)
    flat, bent = cambered(8, rows, 0.0), cambered(8, rows, height)
    plain = linear_wing(8, rows=rows)
    feeding = linear_wing(8, rows=rows, camber=True)
    lifted, straight = feeding.loads(bent, wind(0.03)), plain.loads(flat, wind(0.03 - zero_lift))
    # angles of 0.07 rad: their squares are 0.5 %
    np.testing.assert_allclose(lifted.circulation.gamma, straight.circulation.gamma, rtol=0.01)
    q_area = 0.5 * 1.225 * lifted.circulation.speed**2 * lifted.strips.chord * lifted.strips.width
    couple = np.einsum("ij,ij->i", lifted.moment, lifted.strips.span)
    # with cm = 0 in the polar the moment about the quarter chord is that of the camber; warped arms: rounding
    np.testing.assert_allclose(couple / (q_area * lifted.strips.chord), moment, rtol=1e-9)


def test_without_feedback_and_without_camber_nothing_changes():
    nodes, bent = cambered(6, 6, 0.0), cambered(6, 6, 0.04)
    off, on = linear_wing(6, cm=-0.05, rows=6), linear_wing(6, cm=-0.05, rows=6, camber=True)
    a, b = off.loads(nodes, wind(0.08)), on.loads(nodes, wind(0.08))
    np.testing.assert_allclose(b.force, a.force, rtol=0, atol=1e-10)  # N, of 100
    np.testing.assert_allclose(b.moment, a.moment, rtol=0, atol=1e-10)
    # off, the stations between the edges move where panels are and not what the section carries
    np.testing.assert_array_equal(off.loads(bent, wind(0.08)).circulation.gamma, a.circulation.gamma)


def test_halves_of_a_symmetric_cambered_wing_are_the_whole():
    nodes = arched_nodes(8, rows=5)
    g = grid(8, 5)
    nodes = nodes.reshape(9, 6, 3) + 0.2 * np.linspace(0, 1, 6)[:, None] * (1 - np.linspace(0, 1, 6))[:, None] * [
        0,
        0,
        1,
    ]
    nodes = nodes.reshape(-1, 3)
    wing = linear_wing(8, rows=5, cd=0.02, cm=-0.05, camber=True)
    whole, half = wing.loads(nodes, wind(0.05)), wing.loads(nodes, wind(0.05), symmetric=True)
    assert np.ptp(g.camber(nodes[g.sections], whole.strips.normal)[0]) > 1e-3
    np.testing.assert_allclose(half.force, whole.force, rtol=0, atol=1e-8)  # N, of 100: solved to 1e-12 of circulation
    np.testing.assert_allclose(half.moment, whole.moment, rtol=0, atol=1e-8)
