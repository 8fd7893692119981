"""Equilibria with a closed form."""

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.optimize import brentq

from benchmarks.nets import saddle
from structural import Assembly, Loads, equilibrium, interface_loads, tensions
from tests.structural.models import chains, dead, structure


def _solve(s, loads, x0=None, **options):
    result = equilibrium(Assembly(s), loads, s.nodes if x0 is None else x0, **options)
    assert result.converged, result.status
    return result


def _weights(n, **of_node):
    f = np.zeros((n, 3))
    for node, weight in of_node.items():
        f[int(node[1:]), 2] = -weight
    return dead(f)


@pytest.mark.parametrize("start", [0.4, 1.0, 1.3], ids=["slack", "at rest length", "stretched"])
@pytest.mark.parametrize("two_way", [True, False], ids=["spring", "line"])
def test_weight_hangs_at_rest_length_plus_weight_over_stiffness(two_way, start):
    s = structure([[0, 0, 0], [0, 0, -start]], [True, False], [chains([0, 1], 1.0, 500.0, two_way)])
    result = _solve(s, _weights(2, n1=20.0), atol=1e-9)
    assert result.x[1] == pytest.approx(
        [0.0, 0.0, -1.0 - 20.0 / 500.0], abs=1e-9 / 20.0
    )  # softest stiffness: 20 N / 1 m


def test_line_cannot_push_but_spring_can():
    for two_way, force in ((False, 0.0), (True, -50.0)):
        s = structure([[0, 0, 0], [0, 0, 0.9]], [True, True], [chains([0, 1], 1.0, 500.0, two_way)])
        assert tensions(s.nodes, s.groups[0]) == pytest.approx(force, abs=1e-12)  # rounding of 500 N/m x 1 m


@pytest.mark.parametrize("drop", [0.0, 0.5, -1.2], ids=["level", "low end", "high end"])
@pytest.mark.parametrize("stiffness", [200.0, 1e4, 1e7])
def test_weight_on_a_rope_between_two_points_rests_at_the_lowest_point_of_the_ellipse(stiffness, drop):
    span, l0, weight = 2.0, 3.0, 50.0
    s = structure(
        [[0, 0, 0], [0.8, 0.1, -0.9], [span, 0, -drop]], [True, False, True], [chains([0, 1, 2], l0, stiffness)]
    )
    result = _solve(s, _weights(3, n1=weight), atol=1e-8)

    # Both legs meet the plumb line at the angle t: sin t = span / L, and 2 T cos t = W with T = k (L - l0).
    def balance(length):
        return 2.0 * stiffness * (length - l0) * np.sqrt(length**2 - span**2) / length - weight

    length = brentq(balance, l0, l0 + weight / stiffness + 1.0, xtol=1e-15, rtol=1e-14)
    cosine = np.sqrt(length**2 - span**2) / length
    first = 0.5 * (length + drop / cosine)
    expected = [first * span / length, 0.0, -first * cosine]
    # swinging along the ellipse has about W / L of stiffness: 1e-8 N is 1e-9 m; at 1e7 N/m lengths round to 1e-9 N
    assert result.x[1] == pytest.approx(expected, abs=2e-9)
    tension = tensions(result.x, s.groups[0])[0]
    assert tension == pytest.approx(0.5 * weight / cosine, rel=1e-8)
    legs = np.diff(result.x, axis=0)
    steepness = np.abs(legs[:, 2]) / np.linalg.norm(legs, axis=1)
    assert steepness[0] == pytest.approx(steepness[1], abs=1e-8)


def test_rope_meets_every_loaded_sheave_at_equal_angles():
    """Nested pulleys (LEI thesis 5.4.2): weights on sheaves of one rope, and one sheave hung on another rope's end."""
    nodes = np.array(
        [[0, 0, 0], [1, 0, -1.0], [2, 0, 0], [3, 0, -1.0], [4, 0, 0.0], [1.5, 0.2, -2.0], [0.5, -0.2, -2.5]]
    )
    s = structure(
        nodes,
        [True, False, True, False, True, False, True],
        [chains([0, 1, 2, 3, 4], 6.5, 5e3), chains([[1, 5, 6]], 2.5, 5e3)],
    )
    result = _solve(s, _weights(7, n3=40.0, n5=30.0), atol=1e-9)
    x = result.x
    for before, sheave, after in ((0, 1, 2), (2, 3, 4), (1, 5, 6)):
        u, v = (x[n] - x[sheave] for n in (before, after))
        u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
        pull = tensions(x, s.groups[1 if sheave == 5 else 0])[0]
        hung = (x[5] - x[1]) / np.linalg.norm(x[5] - x[1])  # the second rope pulls at sheave 1 along its first leg
        other = {1: -tensions(x, s.groups[1])[0] * hung, 3: np.array([0, 0, 40.0]), 5: np.array([0, 0, 30.0])}[sheave]
        direction = other / np.linalg.norm(other)
        assert u @ direction == pytest.approx(v @ direction, abs=1e-9)  # 1e-9 N of some 10 N
        assert pull * (u + v) == pytest.approx(other, abs=2e-9)


def test_chain_of_many_lines_approaches_the_elastic_catenary_with_the_square_of_the_link_length():
    span, length, weight, ea = 8.0, 10.0, 30.0, 2000.0  # m, m, N/m, N

    def gap(h):  # half span from H at unstretched length L/2 (Irvine 1981)
        return h * length / ea + 2.0 * h / weight * np.arcsinh(0.5 * weight * length / h) - span

    h = brentq(gap, 1.0, 1e4, xtol=1e-12)
    v = 0.5 * weight * length
    sag = weight * length**2 / (8.0 * ea) + h / weight * (np.sqrt(1.0 + (v / h) ** 2) - 1.0)
    error, pull = [], []
    for links in (8, 16, 32, 64):
        n = np.arange(links + 1)
        t = n / links
        nodes = np.column_stack([span * t, 0.0 * t, -4.0 * sag * t * (1.0 - t)])
        net = chains(np.stack([n[:-1], n[1:]], axis=1), length / links, ea * links / length)
        s = structure(nodes, np.isin(n, [0, links]), [net])
        f = np.zeros((links + 1, 3))
        f[:, 2] = -weight * length / links
        result = _solve(s, dead(f), atol=1e-8)
        error.append(abs(-result.x[links // 2, 2] - sag))
        u = np.diff(result.x[:2], axis=0)[0]
        pull.append(abs(tensions(result.x, net)[0] * u[0] / np.linalg.norm(u) - h))
    for e in (error, pull):
        rates = np.log2(np.array(e[:-1]) / np.array(e[1:]))
        assert rates == pytest.approx(2.0, abs=0.05)  # second order; the next term is a fourth power, small by 8 links
    assert error[-1] <= 1e-3 * sag


@pytest.mark.parametrize("g", [3, 7, 13])
def test_net_of_zero_rest_length_is_the_solution_of_one_linear_system(g):
    s = saddle(g, 0.0, True)
    rng = np.random.default_rng(g)
    force = rng.normal(scale=20.0, size=s.nodes.shape)
    result = _solve(s, dead(force), atol=1e-9)
    a, b = s.groups[0].nodes.T
    n = len(s.nodes)
    adjacency = sp.coo_array((np.full(len(a), 10.0), (a, b)), shape=(n, n))
    laplace = sp.diags_array(np.bincount(np.concatenate([a, b]), minlength=n) * 10.0) - (adjacency + adjacency.T)
    free = ~s.fixed[:, 0]
    k = sp.csc_array(sp.csr_array(laplace)[free][:, free])
    right = force[free] - sp.csr_array(laplace)[free][:, ~free] @ s.nodes[~free]
    linear = s.nodes.copy()
    linear[free] = spla.splu(k).solve(right)
    # the softest mode of the 10 m net has about 10 (pi / g)^2 N/m, at g = 13 still above 0.5 N/m
    assert np.abs(result.x - linear).max() <= 1e-8
    # linear: from nearby, where nothing has to be capped or shifted, one Newton step does it; one more for rounding
    near = linear + 1e-8 * force
    assert _solve(s, dead(force), near, atol=1e-9).iterations <= 2


def test_pressure_in_a_ring_of_lines_gives_hoop_tension_p_times_r():
    """A ring of n lines under internal pressure is a regular polygon: T = p b R cos(pi/n) with R its corner radius."""
    n, pressure, width, k = 24, 200.0, 0.5, 1e5
    angle = 2.0 * np.pi * np.arange(n) / n
    ring = np.column_stack([np.cos(angle), np.zeros(n), np.sin(angle)])
    half = np.array([0.0, 0.5 * width, 0.0])
    nodes = np.concatenate([ring - half, ring + half])
    i = np.arange(n)
    j = (i + 1) % n
    side = 2.0 * np.sin(np.pi / n)
    hoops = chains(np.concatenate([np.stack([i, j], 1), np.stack([i, j], 1) + n]), side, k)
    panels = np.stack([i, i + n, j + n, j], axis=1)
    fixed = np.zeros((2 * n, 3), bool)
    fixed[:, 1] = True  # plane strain
    fixed[[0, n]] = [True, True, True]
    fixed[[n // 2, n + n // 2], 2] = True  # neither turns nor moves, free to grow
    s = structure(nodes, fixed, [hoops], np.eye(2 * n), panels)
    normals = np.cross(nodes[panels[:, 2]] - nodes[panels[:, 0]], nodes[panels[:, 3]] - nodes[panels[:, 1]])
    sign = np.sign(np.sum(normals * nodes[panels[:, 0]], axis=1))[0]
    result = _solve(s, Loads(np.zeros_like(nodes), interface_loads(np.full(n, sign * pressure))), atol=1e-8)
    # each hoop carries half the width: at a corner 2 T sin(pi/n) = p (b/2) l cos(pi/n), with l = side + T side-stretch
    length = brentq(
        lambda l: k * (l - side) - 0.25 * pressure * width * l / np.tan(np.pi / n), side, 2.0 * side, xtol=1e-15
    )
    assert tensions(result.x, hoops) == pytest.approx(k * (length - side), rel=1e-8)  # 1e-8 N of 50 N, rounding of k l


def test_tolerance_is_a_force_and_is_met_or_said_not_to_be():
    s = saddle(5, 0.5, True)
    for atol in (1.0, 1e-3, 1e-6, 1e-9):
        result = _solve(s, dead(np.zeros_like(s.nodes)), atol=atol)
        assert result.residual <= atol
        assembly = Assembly(s)
        r, _ = assembly.residual(assembly.unknowns.restrict(result.x), assembly.prepare(dead(0 * s.nodes)))
        assert np.linalg.norm(r) == pytest.approx(result.residual, abs=1e-12)  # rounding of forces of 10 N
    weight = np.zeros_like(s.nodes)
    weight[:, 2] = -10.0
    relative = _solve(s, dead(weight), atol=0.0, rtol=1e-6)
    assert relative.residual <= 1e-6 * 10.0 * np.sqrt(np.count_nonzero(~s.fixed[:, 0]))


def test_short_stiff_pieces_are_in_equilibrium_to_what_rounding_of_their_places_leaves():
    """A line of 1e9 N in 200 pieces of half a metre, up to 100 m away: eps EA / l x 100 m is 1e-5 N for each of them,
    ten times what is asked for.
    """
    part = np.linspace(0.0, 1.0, 201)
    nodes = np.stack([100.0 * part, 0.0 * part, -24.5 * part * (1.0 - part)], axis=1)
    held = np.isin(np.arange(201), [0, 200])
    pieces = np.stack([np.arange(200), np.arange(1, 201)], axis=1)
    s = structure(nodes, held, [chains(pieces, 0.505, 1e9 / 0.505)])
    result = _solve(s, _weights(201, **{f"n{k}": 5.0 for k in range(1, 200)}))
    first = result.x[0] - result.x[1]
    held_up = tensions(result.x, s.groups[0])[0] * first[2] / np.linalg.norm(first)
    assert held_up == pytest.approx(0.5 * 199 * 5.0, rel=1e-5)  # half of the weight, to the residual of 200 pieces
    assert result.residual < 1e-2
