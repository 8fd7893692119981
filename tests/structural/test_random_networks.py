"""A slice of the random structures of `make stress`: what converged balances, by a checker that shares nothing with the
solver, and what has an equilibrium is found, whatever its size, its loads and its ratios of stiffness.
"""

import numpy as np
import pytest

from benchmarks.elastica import Cantilever, tip
from benchmarks.force_balance import out_of_balance
from benchmarks.network_stress import judged, solved, verdicts
from benchmarks.random_networks import Members, Network, random_network
from structural import Assembly, Chains, Loads, Structure, equilibrium
from structural.solve.cones import ConvexShape


@pytest.mark.parametrize("kind", ["net", "large", "built", "cable", "beams"])
def test_structures_that_have_an_equilibrium_by_convexity_or_construction_come_to_it(kind):
    counted, _ = verdicts(kind, range(8))
    assert counted == {"right": 8}


def test_springs_that_may_push_come_to_an_equilibrium_or_say_that_they_did_not():
    counted, _ = verdicts("springs", range(4, 14, 2))
    assert counted["wrong"] == 0
    assert counted["right"] >= 3


@pytest.mark.parametrize("span", [300.0, 3000.0])
def test_far_reaching_rows_of_short_stiff_elements_meet_a_tolerance_of_rounding(span):
    """600 elements of EA = 1e9 N: positions of 300 m are good to 5e-14 m, which times k is 1e-4 N."""
    n = 600
    nodes = np.column_stack([np.linspace(0.0, span, n + 1), np.zeros(n + 1), np.zeros(n + 1)])
    rows = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    l0 = np.full(n, 1.01 * span / n)
    held = np.isin(np.arange(n + 1), [0, n])
    loads = np.where(held[:, None], 0.0, [0.0, 0.0, -1.0])
    for start in (nodes, nodes - [[0.0, 0.0, 1.0]] * ~held[:, None] * span, 0.3 * nodes + 0.7 * held[:, None] * nodes):
        network = Network(nodes, held, (Members(rows, l0, 1e9 / l0, np.zeros(n, bool)),), loads, start)
        found = solved(network)
        assert judged(network, found) == "right"
        # a chain of 600 N hangs by 6 % or so of its span; half of its weight is on either support
        pull = 1e9 * (np.linalg.norm(found.x[1] - found.x[0]) / l0[0] - 1.0)
        rise = (found.x[0, 2] - found.x[1, 2]) / np.linalg.norm(found.x[1] - found.x[0])
        assert pull * rise == pytest.approx(0.5 * (n - 1), rel=1e-3)  # strain of 1e-6, of 1e-13 of 300 m over 0.5 m


def test_slack_members_do_not_loosen_the_tolerance_of_the_others_by_their_stiffness():
    """A weight of 1e-3 N on a soft line, beside slack lines whose rounding would be more than that."""
    nodes = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [5.0, 0.0, 0.0]])
    lines = Chains(np.array([[0, 1], [1, 2]]), np.array([1.0, 50.0]), np.array([1.0, 1e14]), np.zeros(2, bool))
    s = Structure(nodes, np.array([[True] * 3, [False] * 3, [True] * 3]), (lines,))
    found = equilibrium(Assembly(s), Loads(np.array([[0.0] * 3, [0.0, 0.0, -1e-3], [0.0] * 3])), nodes, 1e-9)
    assert found.converged
    assert found.x[1, 2] == pytest.approx(-1.001, abs=1e-8)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
@pytest.mark.parametrize("force", [1e-3, 1e6])
def test_scaled_networks_have_scaled_equilibria(scale, force):
    """Lengths by `scale`, forces by `force`: the shape is the same, for it depends on neither."""
    given = random_network("built", 3)
    members = tuple(Members(m.nodes, scale * m.l0, force / scale * m.k, m.two_way) for m in given.members)
    other = Network(scale * given.nodes, given.held, members, force * given.loads, scale * given.start)
    assert judged(other, solved(other)) == "right"


def test_the_shape_of_least_energy_is_where_forces_balance():
    """Of lines alone the interior-point method comes to the equilibrium itself, to some 1e-6 of the load."""
    given = random_network("built", 2)
    groups = tuple(Chains(m.nodes, m.l0, m.k, m.two_way) for m in given.members)
    s = Structure(given.nodes, np.repeat(given.held[:, None], 3, axis=1), groups)
    shape = ConvexShape(Assembly(s), Loads(given.loads), given.start, groups)
    assert shape.iterations < 60
    assert out_of_balance(given, shape.x)[0] <= 1e-4 * np.linalg.norm(given.loads)


def test_the_elastica_is_that_of_published_tables():
    """P l^2 / EI = 1: the tip falls by 0.30172 and comes nearer by 0.05643 of the length (Mattiasson 1981)."""
    beam = Cantilever(1.0, 1.0, 1.0, 20, np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0]))
    assert tip(beam) == pytest.approx([1.0 - 0.05643, 0.0, -0.30172], abs=1e-5)
