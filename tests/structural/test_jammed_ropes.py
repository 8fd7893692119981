"""Sheaves that run onto an end of their rope, or onto each other: the knob there makes the jam an equilibrium."""

import numpy as np
import pytest

from structural import Assembly, equilibrium
from structural.elements.chains import KNOB, chain_energy, chain_forces, chain_forces_and_tangents, tensions
from tests.structural.models import TANGENT_TOLERANCE, central_difference, chains, dead, structure

REST, STIFFNESS = 1.9, 1000.0


def _atwood(heavy, light):
    """A rope over one fixed sheave with a weight N at either end."""
    nodes = np.array([[-0.1, 0, -1.0], [0, 0, 0], [0.1, 0, -1.0]])
    force = np.zeros((3, 3))
    force[:, 2] = [-heavy, 0.0, -light]
    return structure(nodes, [False, True, False], [chains([0, 1, 2], REST, STIFFNESS)]), dead(force)


@pytest.mark.parametrize("spread", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("light", [0.0, 1.0, 10.0, 19.0])
def test_light_weight_of_atwoods_machine_jams_in_the_knob_of_the_sheave(light, spread):
    heavy = 20.0
    s, loads = _atwood(heavy, light)
    start = s.nodes + np.random.default_rng(3).normal(scale=spread, size=s.nodes.shape)
    start[1] = 0.0
    result = equilibrium(Assembly(s), loads, start, atol=1e-9)
    assert result.converged
    # the heavy side makes the tension; the knob carries the light one with T l / knob
    knob = KNOB * REST
    short = knob * light / heavy
    long = REST + heavy / STIFFNESS - 0.5 * (short**2 / knob + knob)
    # the softest stiffness is that of the long leg's swing, 20 N / 1.9 m: 1e-9 N are 1e-10 m
    assert result.x == pytest.approx(np.array([[0, 0, -long], [0, 0, 0], [0, 0, -short]]), abs=1e-9)
    assert result.iterations <= 150  # 6 to 91 seen


def _rope(leg):
    """A rope over two sheaves, the middle leg `leg` times as long as the knob."""
    x = np.array([[0.0, 0, 0], [0.7, 0.2, 0.4], [0.7, 0.2, 0.4], [1.1, 0.5, -0.3]])
    x[2] += leg * KNOB * np.array([2.0, -1.0, 2.0]) / 3.0
    return x, chains([0, 1, 2, 3], 1.0, 250.0)


@pytest.mark.parametrize("leg", [0.0, 0.3, 0.9, 1.1, 3.0])
def test_tangent_of_a_rope_with_a_short_leg_is_the_derivative_of_its_forces_and_these_of_its_energy(leg):
    x, rope = _rope(leg)
    f, k = chain_forces_and_tangents(x, rope)
    assert np.array_equal(f, chain_forces(x, rope))
    step = 1e-3 * KNOB  # the curvature of the leg's length has the knob as its scale
    energy = central_difference(lambda y: np.array([chain_energy(y, rope)]), x, step)
    # truncation T (step / leg)^2 / 6 of 150 N; rounding of some 40 J over steps of 1e-6 m is 1e-8 N
    assert f[0].reshape(-1) == pytest.approx(energy.reshape(-1), abs=1e-4)
    numeric = central_difference(lambda y: chain_forces(y, rope), x, step)
    assert np.abs(k[0] - numeric).max() <= 3.0 * TANGENT_TOLERANCE * np.abs(k).max()  # truncation, (step / leg)^2 / 2


def test_legs_longer_than_the_knob_have_their_own_length_and_its_surface_is_smooth():
    for leg in (1.0, 1.5, 100.0):
        x, rope = _rope(leg)
        length = np.linalg.norm(np.diff(x, axis=0), axis=1).sum()
        assert tensions(x, rope)[0] == pytest.approx(250.0 * (length - 1.0), rel=1e-13)  # rounding
    inside, outside = (chain_forces(*_rope(leg)) for leg in (1.0 - 1e-9, 1.0 + 1e-9))
    assert np.abs(inside - outside).max() <= 1e-5  # 2e-9 of a change that is of the order of the force, some 100 N


def test_lines_and_springs_of_two_nodes_have_no_knob():
    x = np.array([[0.0, 0, 0], [1e-5, 0, 0]])
    assert tensions(x, chains([0, 1], 1.0, 500.0, True))[0] == pytest.approx(500.0 * (1e-5 - 1.0), rel=1e-13)


@pytest.mark.parametrize("start", [-0.5, -0.01, 0.7], ids=["loose end low", "close to the sheave", "above it"])
def test_free_sheave_pulled_harder_than_twice_its_loose_end_hauls_that_end_in(start):
    # A bridle's corner: the rope runs from a support up to a free sheave, its other end hangs down with a weight. The
    # rope could carry 2 x 30 N; with 100 N on the sheave the end comes up until it jams: T = 100 N - 30 N.
    pull, weight = 100.0, 30.0
    nodes = np.array([[0, 0, 0], [0.05, -0.02, 1.2], [0.1, 0.03, 1.2 + start]])
    s = structure(nodes, [True, False, False], [chains([0, 1, 2], REST, 2e4)])
    force = np.zeros((3, 3))
    force[1:, 2] = pull, -weight
    result = equilibrium(Assembly(s), dead(force), nodes, atol=1e-9)
    assert result.converged
    tension = pull - weight
    assert tensions(result.x, s.groups[0])[0] == pytest.approx(tension, abs=1e-8)  # 1e-9 N, rounding of 2e4 N/m x 2 m
    knob = KNOB * REST
    short = knob * weight / tension
    height = REST + tension / 2e4 - 0.5 * (short**2 / knob + knob)
    # swinging has 70 N / 1.9 m: 1e-9 N are 1e-10 m
    assert result.x[1:] == pytest.approx(np.array([[0, 0, height], [0, 0, height - short]]), abs=1e-9)
