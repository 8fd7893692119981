"""Derivatives of dampers, wind and whole motions against central differences, and what an implicit step costs."""

import numpy as np
import pytest

from benchmarks.particle_steps import chain, square
from structural import Chains, Wind, damping_forces
from structural.dynamics import GeneralisedAlpha, ImplicitEuler, Motion, integrate
from structural.dynamics.steps import factorised
from structural.elements.chains import damping_forces_and_tangents
from structural.loads.legs import drag_forces, drag_forces_and_tangents

from .models import TANGENT_TOLERANCE, central_difference, lengths
from .particles import particles, row

RNG = np.random.default_rng(7)
X, V = RNG.normal(size=(6, 3)), RNG.normal(size=(6, 3))
SPRINGS, ROPES = np.array([[0, 1], [2, 3], [4, 5]]), np.array([[0, 1, 2], [3, 4, 5]])


def _scattered(tangents, nodes):
    """Element tangents (e,3m,3m) as derivatives of all element forces by all coordinates (3 m e, 18)."""
    e, m = nodes.shape
    out = np.zeros((e, 3 * m, 18))
    for i in range(e):
        for a, n in enumerate(nodes[i]):
            out[i, :, 3 * n : 3 * n + 3] += tangents[i, :, 3 * a : 3 * a + 3]
    return out.reshape(-1, 18)


@pytest.mark.parametrize("nodes", [SPRINGS, ROPES], ids=["springs", "ropes"])
@pytest.mark.parametrize("two_way", [True, False])
@pytest.mark.parametrize("c", [0.3, 50.0], ids=["light", "heavy"])
def test_tangents_of_dampers_are_exact(nodes, two_way, c):
    e = len(nodes)
    # the rates are of either sign, and heavy dampers of lines would push: all branches are met
    given = 0.7 * lengths(X, nodes), np.full(e, 10.0), np.full(e, two_way)
    elements = Chains(nodes, *given, (), np.full(e, c), np.linspace(-0.2, 0.2, e))
    f, by_x, by_v = damping_forces_and_tangents(X, V, elements)
    assert np.array_equal(f, damping_forces(X, V, elements))
    for found, function, at in (
        (by_x, lambda x: damping_forces(x, V, elements), X),
        (by_v, lambda v: damping_forces(X, v, elements), V),
    ):
        exact = central_difference(function, at)
        assert np.abs(_scattered(found, nodes) - exact).max() <= TANGENT_TOLERANCE * max(np.abs(exact).max(), 1.0)


def test_dampers_take_no_force_from_rigid_motion_and_only_take_energy():
    spin, shift = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, 3.0])
    elements = Chains(ROPES, np.zeros(2), np.ones(2), np.ones(2, bool), (), np.full(2, 4.0))
    rigid = shift + np.cross(spin, X)
    assert np.abs(damping_forces(X, rigid, elements)).max() < 1e-12
    power = np.sum(damping_forces(X, V, elements) * V[ROPES])
    assert power > 0.0  # against the motion


def test_a_line_never_pushes_however_fast_it_shortens():
    line = Chains(
        SPRINGS[:1], 0.99 * lengths(X, SPRINGS[:1]), np.array([100.0]), np.array([False]), (), np.array([1e4])
    )
    towards = np.zeros((6, 3))
    towards[1] = -(X[1] - X[0])  # shortens
    elastic = 100.0 * 0.01 * lengths(X, SPRINGS[:1])[0]
    force = damping_forces(X, towards, line)[0, 1]
    assert np.linalg.norm(force) == pytest.approx(elastic, rel=1e-9)  # takes all of the pull, and no more


@pytest.mark.parametrize("law", ["inclined", "projected"])
def test_tangents_of_wind_on_legs_are_exact(law):
    wind = Wind(np.array([6.0, 1.0, 2.0]), 1.2, 1.1, 0.02, law)
    ends, speeds, d = RNG.normal(size=(4, 2, 3)), RNG.normal(size=(4, 2, 3)), np.full(4, 0.02)
    f, by_x, by_v = drag_forces_and_tangents(ends, speeds, d, wind)
    assert np.allclose(f, drag_forces(ends, speeds, d, wind), rtol=1e-12)
    for found, function, at in (
        (by_x, lambda x: drag_forces(x, speeds, d, wind), ends),
        (by_v, lambda v: drag_forces(ends, v, d, wind), speeds),
    ):
        exact = central_difference(function, at).reshape(4, 6, 4, 6)
        own = np.stack([exact[k, :, k] for k in range(4)])
        assert np.abs(found - own).max() <= TANGENT_TOLERANCE * np.abs(own).max()


def test_wind_on_legs_is_that_of_the_flow():
    from aero import line_loads

    wind = Wind(np.array([6.0, 1.0, 2.0]), 1.2, 1.1, 0.02)
    ends, speeds, d = RNG.normal(size=(4, 2, 3)), RNG.normal(size=(4, 2, 3)), np.full(4, 0.02)
    load = line_loads(ends, d, wind.velocity - speeds.mean(axis=1), 1.2, 1.1, 0.02)
    force = load * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    assert np.allclose(drag_forces(ends, speeds, d, wind).sum(axis=1), force, rtol=1e-12)


def test_the_tangent_of_a_whole_motion_is_exact():
    wind = Wind(np.array([6.0, 1.0, 0.0]))
    nodes = np.array([[0.0, 0, 0], [1.1, 0.1, 0], [2.1, -0.1, 0.3], [3.0, 0.2, 0.1]])
    motion, x = particles(nodes, [0, 3], row(4, 50.0, 0.9, c=3.0), wind=wind, diameter=0.05)
    q = motion.unknowns.restrict(x)
    v = RNG.normal(size=q.shape)
    r, data, rates, _ = motion.evaluated(q, v, 0.0)
    for found, function, at in (
        (data, lambda z: motion.evaluated(z, v, 0.0)[0], q),
        (rates, lambda z: motion.evaluated(q, z, 0.0)[0], v),
    ):
        exact = central_difference(function, at)
        own = motion.assembly.matrix(found).toarray()
        assert np.abs(own - exact).max() <= TANGENT_TOLERANCE * np.abs(exact).max()
    elastic, damping, external = motion.forces(q, v, 0.0)
    assert np.allclose(elastic + damping - external, r, atol=1e-12)


def test_masses_with_directions_resist_along_them_only():
    nodes = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    motion, x = particles(nodes, [0], row(2, 1e-300, 1.0), dead=np.ones((2, 3)))
    normal = np.array([0.0, 0.6, 0.8])
    blocks = np.eye(3) + 9.0 * np.multiply.outer(normal, normal) * np.array([0.0, 1.0])[:, None, None]
    heavy = Motion(motion.assembly, blocks, motion._loads(0.0), motion.groups(0.0))
    a = heavy.velocities(heavy.at(x).a)[1]
    assert a @ normal == pytest.approx(1.4 / 10.0)
    assert np.cross(a, normal) == pytest.approx(np.cross(np.ones(3), normal))
    # one step: dv = a h, in any scheme
    end = integrate(heavy, heavy.at(x), 0.1, GeneralisedAlpha(), step=0.1).state
    assert heavy.velocities(end.v)[1] == pytest.approx(0.1 * a, rel=1e-9)


@pytest.mark.parametrize(("model", "per_row"), [(chain, 9), (square, 27)], ids=["chain", "net"])
def test_systems_of_steps_are_sparse_and_their_factors_grow_with_the_particles_of_a_chain(model, per_row):
    fill = []
    for n in (500, 2000):
        motion, state = model(n)
        _, data, _, _ = motion.evaluated(state.q, state.v, 0.0)
        motion.mass(0.0).add_to(data, motion.assembly.diagonal, 1e6)
        matrix = motion.assembly.matrix(data)
        assert matrix.nnz <= per_row * matrix.shape[0]
        fill.append(factorised(matrix).nnz)
    # in proportion on a chain; on a net between n log n and n^1.5, 8 times
    assert fill[1] <= (4.1 if model is chain else 8.0) * fill[0]


def test_a_linear_step_costs_in_proportion_to_the_particles():
    import time

    seconds = []
    for n in (2000, 8000):
        motion, state = chain(n)
        best = np.inf
        for _ in range(3):
            begin = time.perf_counter()
            integrate(motion, state, 1e-3, ImplicitEuler(linear=True), step=1e-3)
            best = min(best, time.perf_counter() - begin)
        seconds.append(best)
    assert seconds[1] < 8.0 * seconds[0]  # 4 if nothing else runs; a dense matrix would take 64
