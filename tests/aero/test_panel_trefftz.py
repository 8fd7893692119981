"""Forces in the Trefftz plane: optimal loadings, closed and branching wakes, and what no wake can do."""

import numpy as np
import pytest

from aero.panel.trefftz import far_wake

ALONG = np.array([1.0, 0.0, 0.0])


def cosine(n):
    """Nodes of a flat sheet of unit half span, and its strips."""
    y = -np.cos(np.pi * np.arange(n + 1) / n)
    return np.column_stack([0.0 * y, y, 0.0 * y]), np.column_stack([np.arange(n), np.arange(1, n + 1)])


def elliptic(nodes):
    """Mean jumps over the strips of a sheet that lifts upwards with elliptic loading."""
    y = nodes[:, 1]
    area = 0.5 * (y * np.sqrt(np.maximum(1.0 - y * y, 0.0)) + np.arcsin(np.clip(y, -1.0, 1.0)))
    return -np.diff(area) / np.diff(y)


def test_elliptic_loading_has_span_efficiency_one_with_order_two():
    found = [far_wake(*sheet, elliptic(sheet[0]), ALONG, 1.0, 1.0) for sheet in map(cosine, (20, 40, 80))]
    off = [abs(f.span_efficiency(2.0, 0.5) - 1.0) for f in found]
    assert off[2] < 1.5e-3
    assert min(off[0] / off[1], off[1] / off[2]) > 3.7  # 4 is order 2


def test_lift_is_that_of_kutta_and_joukowski_upwards_and_drag_is_along_the_stream():
    sheet = cosine(12)
    found = far_wake(*sheet, np.full(12, -3.0), ALONG, 5.0, 1.2)
    np.testing.assert_allclose(found.lift, [0.0, 0.0, 1.2 * 5.0 * 3.0 * 2.0], rtol=1e-13)  # closed form
    assert found.induced_drag > 0.0


@pytest.mark.parametrize("seed", range(5))
def test_induced_drag_is_never_negative_and_grows_with_the_square_of_the_load(seed):
    rng = np.random.default_rng(seed)
    nodes, ends = rng.standard_normal((9, 3)), np.column_stack([np.arange(8), np.arange(1, 9)])
    jumps = rng.standard_normal(8)
    one, three = (far_wake(nodes, ends, k * jumps, ALONG, 7.0, 1.2) for k in (1.0, 3.0))
    assert one.induced_drag > 0.0
    np.testing.assert_allclose(three.induced_drag, 9.0 * one.induced_drag, rtol=1e-12)  # a quadratic form


def test_a_closed_ring_of_constant_jump_sheds_nothing_and_lifts_nothing():
    angle = 2.0 * np.pi * np.arange(16) / 16
    nodes = np.column_stack([0.3 * np.sin(angle), np.cos(angle), 0.4 * np.sin(angle)])
    ends = np.column_stack([np.arange(16), (np.arange(16) + 1) % 16])
    found = far_wake(nodes, ends, np.full(16, 2.0), ALONG, 5.0, 1.2)
    np.testing.assert_allclose(found.lift, 0.0, atol=1e-13)
    assert abs(found.induced_drag) < 1e-25  # rounding, squared


def test_the_best_box_of_height_zero_point_two_has_the_span_efficiency_of_prandtl():
    """Prandtl (1924, NACA TN 182): D / D_monoplane = (1 + 0.45 h) / (1.04 + 2.81 h) of the best closed box, h = 0.2 of
    the span; the optimum found here among all loadings of the strips.
    """
    n, h = 18, 0.4
    y = -np.cos(np.pi * np.arange(n + 1) / n)
    z = -0.5 * h * np.cos(np.pi * np.arange(1, 6) / 6)
    ring = np.concatenate([
        np.column_stack([y, np.full(n + 1, 0.5 * h)]), np.column_stack([np.ones(5), -z]),
        np.column_stack([-y, np.full(n + 1, -0.5 * h)]), np.column_stack([-np.ones(5), z]),
    ])  # fmt: skip
    nodes = np.column_stack([np.zeros(len(ring)), ring])
    ends = np.column_stack([np.arange(len(ring)), (np.arange(len(ring)) + 1) % len(ring)])
    unit = np.eye(len(ring))
    lifts = np.array([far_wake(nodes, ends, row, ALONG, 1.0, 1.0).lift[2] for row in unit])
    drag = np.zeros((len(ring), len(ring)))
    for i, j in zip(*np.triu_indices(len(ring)), strict=True):
        drag[i, j] = drag[j, i] = far_wake(nodes, ends, unit[i] + unit[j], ALONG, 1.0, 1.0).induced_drag
    single = np.array([far_wake(nodes, ends, a, ALONG, 1.0, 1.0).induced_drag for a in unit])
    form = 0.5 * (drag - single[:, None] - single)
    best = np.linalg.lstsq(form, lifts, rcond=1e-9)[0]
    found = far_wake(nodes, ends, best, ALONG, 1.0, 1.0)
    prandtl = (1.04 + 2.81 * 0.2) / (1.0 + 0.45 * 0.2)
    np.testing.assert_allclose(found.span_efficiency(2.0, 0.5), prandtl, rtol=0.02)  # his formula is a fit, to 1 %


def test_a_wake_that_branches_sheds_nothing_where_its_circulations_add_up():
    """A sheet from the left whose circulation goes on in two sheets one above the other is that of two whole sheets."""
    nodes = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1e-6]])
    branch = far_wake(nodes, np.array([[0, 1], [1, 2], [1, 3]]), np.array([-2.0, -1.0, -1.0]), ALONG, 1.0, 1.0)
    whole = far_wake(nodes, np.array([[0, 1], [1, 2]]), np.array([-2.0, -2.0]), ALONG, 1.0, 1.0)
    np.testing.assert_allclose(branch.induced_drag, whole.induced_drag, rtol=1e-4)  # 1e-6 apart, under a logarithm
    np.testing.assert_allclose(branch.lift, whole.lift, atol=1e-5)


def test_forces_turn_with_wake_and_stream_and_do_not_see_where_along_the_stream_strips_begin():
    rng = np.random.default_rng(3)
    nodes, ends, jumps = rng.standard_normal((9, 3)), cosine(8)[1], rng.standard_normal(8)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    one = far_wake(nodes, ends, jumps, ALONG, 7.0, 1.2)
    other = far_wake(nodes @ turn.T, ends, jumps, turn @ ALONG, 7.0, 1.2)
    swept = far_wake(nodes + rng.standard_normal((9, 1)) * ALONG, ends, jumps, ALONG, 7.0, 1.2)
    for found, lift in ((other, turn @ one.lift), (swept, one.lift)):
        np.testing.assert_allclose(found.lift, lift, atol=1e-12)
        np.testing.assert_allclose(found.induced_drag, one.induced_drag, rtol=1e-11)
