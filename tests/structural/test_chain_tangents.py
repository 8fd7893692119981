"""Forces and tangents of springs, lines and ropes over sheaves."""

import numpy as np
import pytest

from structural import tensions
from structural.elements.chains import Chains, chain_energy, chain_forces, chain_forces_and_tangents
from tests.structural.models import KINK, TANGENT_TOLERANCE, central_difference, chains, clear_of_kinks, lengths


def _random_chain(rng, nodes, ratio, two_way):
    """One element of `nodes` nodes at random points of a 2 m box, rest length `ratio` x length, legs above 0.1 m."""
    while True:
        x = rng.uniform(-1.0, 1.0, (nodes, 3))
        c = chains(np.arange(nodes), 1.0, rng.uniform(10.0, 1e4), two_way)
        if np.linalg.norm(np.diff(x, axis=0), axis=1).min() < 0.1:
            continue  # curvature of a leg grows as 1/l: differences of step h need l >> h
        c = Chains(c.nodes, ratio * lengths(x, c.nodes), c.k, c.two_way)
        if clear_of_kinks(x, [c]):
            return x, c


@pytest.mark.parametrize("two_way", [True, False], ids=["two-way", "tension-only"])
@pytest.mark.parametrize("nodes", [2, 3, 4, 5], ids=["leg", "1-sheave", "2-sheaves", "3-sheaves"])
def test_force_is_the_gradient_of_energy_and_tangent_the_gradient_of_force(nodes, two_way):
    rng = np.random.default_rng(10 * nodes + two_way)
    for _ in range(100):
        # rest lengths from slack or compressed (1.5) to strongly stretched (0.3) and, for springs, zero
        x, c = _random_chain(rng, nodes, rng.choice([0.0, 0.3, 0.9, 1.05, 1.5]), two_way)
        force, tangent = chain_forces_and_tangents(x, c)
        gradient = central_difference(lambda y, c=c: chain_energy(y, c), x)
        slope = central_difference(lambda y, c=c: chain_forces(y, c), x)
        scale = c.k[0]
        # energies are about k m^2, and rounding of them by eps over a step of 1e-6 m leaves 1e-10 of k
        assert np.abs(gradient.ravel() - force.ravel()).max() <= 1e-8 * scale
        assert np.abs(slope - tangent[0]).max() <= TANGENT_TOLERANCE * scale
        assert np.array_equal(force, chain_forces(x, c))


@pytest.mark.parametrize("nodes", [2, 3, 4, 5])
def test_tangent_is_symmetric_and_knows_rigid_translation_and_rotation(nodes):
    rng = np.random.default_rng(nodes)
    for _ in range(100):
        x, c = _random_chain(rng, nodes, rng.choice([0.5, 0.9]), False)
        force, tangent = (a[0] for a in chain_forces_and_tangents(x, c))
        rounding = 1e-12 * np.abs(tangent).max()  # sums of a few dozen products of order K
        assert np.abs(tangent - tangent.T).max() <= rounding
        assert np.abs(tangent @ np.tile(np.eye(3), (nodes, 1))).max() <= rounding
        spin = rng.normal(size=3)
        # forces turn with the element: K (w x x) = w x f
        assert np.abs(tangent @ np.cross(spin, x).ravel() - np.cross(spin, force).ravel()).max() <= 20.0 * rounding


@pytest.mark.parametrize("nodes", [2, 3, 4, 5])
def test_tangent_of_a_tight_tension_only_chain_has_no_negative_stiffness(nodes):
    rng = np.random.default_rng(nodes)
    for _ in range(100):
        x, c = _random_chain(rng, nodes, 0.7, False)
        _, tangent = chain_forces_and_tangents(x, c)
        assert (
            np.linalg.eigvalsh(tangent[0]).min() >= -1e-11 * np.abs(tangent).max()
        )  # eigenvalues to eps ||K||, zero exactly


@pytest.mark.parametrize("nodes", [2, 3, 4])
def test_slack_rope_has_neither_force_nor_stiffness(nodes):
    rng = np.random.default_rng(nodes)
    x, c = _random_chain(rng, nodes, 1.2, False)
    force, tangent = chain_forces_and_tangents(x, c)
    assert not force.any()
    assert not tangent.any()


def test_spring_of_zero_rest_length_is_linear_down_to_zero_length():
    c = chains([0, 1], 0.0, 250.0, True)
    block = 250.0 * np.block([[np.eye(3), -np.eye(3)], [-np.eye(3), np.eye(3)]])
    rng = np.random.default_rng(1)
    for length in (0.0, 1e-140, 1e-12, 1.0):
        x = np.vstack([np.zeros(3), length * rng.normal(size=3)])
        force, tangent = chain_forces_and_tangents(x, c)
        # k (u u^T + (I - u u^T)): rounding of unit vectors
        assert np.abs(tangent[0] - block).max() <= 1e-13 * 250.0
        assert force[0].ravel() == pytest.approx(block @ x.ravel(), rel=1e-13, abs=0.0)


def test_slack_line_of_zero_length_is_at_rest():
    force, tangent = chain_forces_and_tangents(np.zeros((2, 3)), chains([0, 1], 1.0, 100.0, False))
    assert not force.any()
    assert not tangent.any()


def test_rope_pulls_equally_on_both_sides_of_every_sheave():
    rng = np.random.default_rng(3)
    for nodes in (3, 4, 5):
        x, c = _random_chain(rng, nodes, 0.8, False)
        force = chain_forces(x, c)[0]
        t = c.k[0] * (lengths(x, c.nodes)[0] - c.l0[0])
        assert tensions(x, c)[0] == pytest.approx(t, rel=1e-14)
        assert np.linalg.norm(force[[0, -1]], axis=1) == pytest.approx(t, rel=1e-13)  # rounding of unit vectors
        u = np.diff(x, axis=0) / np.linalg.norm(np.diff(x, axis=0), axis=1)[:, None]
        for i in range(1, nodes - 1):
            assert force[i] == pytest.approx(t * (u[i - 1] - u[i]), abs=1e-12 * t)


def test_energy_is_half_k_times_stretch_squared_and_zero_when_slack():
    x = np.array([[0.0, 0, 0], [3.0, 4.0, 0], [3.0, 4.0, 2.0]])
    rope = chains([0, 1, 2], 6.0, 10.0, False)  # 7 m long
    assert chain_energy(x, rope) == pytest.approx(0.5 * 10.0 * 1.0, rel=1e-14)
    assert chain_energy(x, chains([0, 1, 2], 7.5, 10.0, False)) == 0.0
    assert chain_energy(x, chains([0, 1, 2], 7.5, 10.0, True)) == pytest.approx(0.5 * 10.0 * 0.25, rel=1e-14)


def test_many_elements_give_the_sum_of_single_ones():
    rng = np.random.default_rng(8)
    x = rng.uniform(-1, 1, (9, 3))
    rows = np.array([rng.choice(9, 3, replace=False) for _ in range(20)])
    c = Chains(rows, rng.uniform(0.5, 1.2, 20) * lengths(x, rows), rng.uniform(1, 100, 20), rng.random(20) < 0.5)
    assert np.all(c.two_way | (np.abs(lengths(x, rows) - c.l0) > KINK))
    force, tangent = chain_forces_and_tangents(x, c)
    for i in range(20):
        f, k = chain_forces_and_tangents(x, c.select(np.array([i])))
        assert np.array_equal(f[0], force[i])
        assert np.array_equal(k[0], tangent[i])
