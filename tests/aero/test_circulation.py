"""Newton on the circulation: Jacobian, symmetry, starts, and what it says about itself beyond stall."""

from itertools import pairwise

import numpy as np
import pytest

from aero.vortex_step.circulation import ACCEPTED, SectionFlow, attached_start, solve
from aero.vortex_step.strips import strips_between
from aero.vortex_step.vortices import control_influence
from tests.aero.wings import arched_nodes, linear_wing, stalling_wing, wind


def flow_on(nodes, velocity, wing, induction=True, viscosity=None, far=False):
    sections = nodes[wing.grid.sections]
    strips = strips_between(sections[:, 0], sections[:, 2])
    influence = control_influence(strips, velocity / np.linalg.norm(velocity)) if induction else None
    across = velocity - (strips.span @ velocity)[:, None] * strips.span
    far_speed = np.linalg.norm(across, axis=1) if far else None
    return SectionFlow(influence, velocity, strips, wing.polars, viscosity, far_speed)


def pieces(flow, gamma):
    """Which polar piece every strip is on, -1 and the last beyond the table."""
    return np.searchsorted(flow.polars.alpha, flow.imbalance(gamma)[1][4])


def random_states(count, strips, induction):
    """Deformed wings with random circulations from deep below to far beyond stall, clear of the polar's knots.

    At a knot the curvature of the polar jumps, at the table's ends its slope does: a central difference across it is
    wrong by h times the jump, whatever the Jacobian. States with a knot within the difference step are drawn again.
    """
    rng = np.random.default_rng(strips)
    wing = stalling_wing(strips)
    while count:
        nodes = arched_nodes(strips, 0.05, rng)
        nu = rng.uniform(0.0, 1.0, strips) if induction and rng.random() < 0.3 else None
        flow = flow_on(nodes, wind(rng.uniform(-0.3, 0.6)), wing, induction, nu, far=bool(count % 2))
        gamma = rng.uniform(-1.0, 2.0) * attached_start(flow) + rng.normal(0.0, 1.0, strips)
        h = 1e-6 * np.abs(gamma).max()
        here = pieces(flow, gamma)
        if all(np.array_equal(here, pieces(flow, gamma + s * h * e)) for e in np.eye(strips) for s in (1.0, -1.0)):
            count -= 1
            yield flow, gamma, h


@pytest.mark.parametrize("induction", [True, False])
def test_the_jacobian_is_the_derivative_of_the_imbalance_at_100_deformed_wings_stalled_ones_included(induction):
    stalled = beyond = 0
    for flow, gamma, h in random_states(100, 9, induction):
        _, state = flow.imbalance(gamma)
        exact = flow.jacobian(state)
        steps = [(gamma + h * e, gamma - h * e) for e in np.eye(9)]
        differences = [(flow.imbalance(a)[0] - flow.imbalance(b)[0]) / (2.0 * h) for a, b in steps]
        # rounding 1e-16 gamma / h = 1e-10; the cubic term h^2 F''' / 6 is 2e-8 here (2e-6 with ten times the step)
        np.testing.assert_allclose(exact, np.array(differences).T, rtol=0, atol=1e-6 * np.abs(exact).max())
        stalled += np.any(state[6] < 0.0)
        beyond += np.any(state[7])
    if induction:  # the states are what the name says
        assert stalled >= 40
        assert beyond >= 15


def test_strip_theory_sees_every_section_alone():
    flow = flow_on(arched_nodes(9), wind(0.1), stalling_wing(9), induction=False)
    assert np.array_equal(flow.jacobian(flow.imbalance(np.ones(9))[1]), np.eye(9))


@pytest.mark.parametrize("strips", [12, 13])
@pytest.mark.parametrize("alpha", [-0.2, 0.0, 0.1])
@pytest.mark.parametrize("direction", ["bound", "control"])
def test_half_of_a_symmetric_wing_gives_the_solution_of_the_whole(strips, alpha, direction):
    wing, nodes = stalling_wing(strips, direction=direction), arched_nodes(strips)
    half, whole = (wing.loads(nodes, wind(alpha), symmetric=s) for s in (True, False))
    # both are solved to 1e-12 of U c / 2 = 12 m^2/s, and the Jacobian multiplies that by less than 100
    np.testing.assert_allclose(half.circulation.gamma, whole.circulation.gamma, rtol=0, atol=1e-9)
    np.testing.assert_allclose(half.circulation.alpha, whole.circulation.alpha, rtol=0, atol=1e-10)
    np.testing.assert_allclose(half.pressure, whole.pressure, rtol=0, atol=1e-8)  # Pa, of 100
    np.testing.assert_allclose(half.shear, whole.shear, rtol=0, atol=1e-8)
    np.testing.assert_allclose(half.moment, whole.moment, rtol=0, atol=1e-8)  # N m, of 10


def test_a_converged_attached_solution_does_not_depend_on_the_start():
    wing, nodes = stalling_wing(14), arched_nodes(14)
    cold = wing.loads(nodes, wind(0.05)).circulation
    assert cold.viscosity == 0.0
    for start in (0.0 * cold.gamma, wing.loads(nodes, wind(0.02)).circulation.gamma, 1.3 * cold.gamma):
        warm = wing.loads(nodes, wind(0.05), start).circulation
        assert warm.converged
        np.testing.assert_allclose(warm.gamma, cold.gamma, rtol=0, atol=1e-9)  # tolerance 1e-12 of 12 m^2/s, times 100
    again = wing.loads(nodes, wind(0.05), cold.gamma).circulation
    assert again.newton_iterations == 0
    assert np.array_equal(again.gamma, cold.gamma)


def test_newton_converges_quadratically_on_an_attached_wing():
    flow = flow_on(arched_nodes(14), wind(0.04), stalling_wing(14))
    gamma, errors, solution = 0.0 * attached_start(flow), [], solve(flow, attached_start(flow)).gamma
    for _ in range(4):
        errors.append(np.linalg.norm(gamma - solution))
        f, state = flow.imbalance(gamma)
        gamma = gamma - np.linalg.solve(flow.jacobian(state), f)
    # e_(k+1) = C e_k^2 with a C that settles at about 0.01 s/m^2: from 20 m^2/s to rounding in three Newton iterations
    ratios = [after / before**2 for before, after in pairwise(errors) if after > 1e-10]
    assert len(ratios) >= 2
    assert max(ratios) < 0.05  # five times the value it settles at


def test_the_attached_start_solves_a_wing_of_linear_polars_to_second_order_in_the_angle():
    """cl = 2 pi alpha: what is left is alpha - tan alpha and the change of speed, so halving the angle quarters it."""
    errors = []
    for alpha in (0.02, 0.01):
        flow = flow_on(flat_nodes(10), wind(alpha), linear_wing(10))
        start = attached_start(flow)
        errors.append(np.abs(start - solve(flow, start).gamma).max() / np.abs(start).max())
    # the relative error is of order alpha^2 for a symmetric section: exactly 4, to 5 % by the next even order
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def flat_nodes(strips, span=8.0, chord=1.0):
    y = np.linspace(-0.5 * span, 0.5 * span, strips + 1)
    edge = np.stack([0 * y, y, 0 * y], axis=1)
    aft = edge + np.array([chord, 0.0, 0.0])
    return np.stack([edge, 0.5 * (edge + aft), aft], axis=1).reshape(-1, 3)


@pytest.mark.parametrize("strips", [9, 18])
@pytest.mark.parametrize("warm", [False, True])
def test_beyond_stall_the_status_tells_the_truth(strips, warm):
    """Whatever branch is found, `converged` means that the stated (viscous or not) problem is solved."""
    wing, nodes, start = stalling_wing(strips), arched_nodes(strips), None
    scale = 0.5 * 2.2 * 12.0 * np.sqrt(strips)
    for degrees in range(-10, 31, 2):
        velocity = wind(np.deg2rad(degrees))
        c = wing.loads(nodes, velocity, start).circulation
        assert np.all(np.isfinite(c.gamma))
        assert c.converged == (c.residual <= ACCEPTED)
        if c.converged and c.viscosity == 0.0:
            f, _ = flow_on(nodes, velocity, wing).imbalance(c.gamma)
            assert np.linalg.norm(f) <= 1.1 * ACCEPTED * scale  # 1.1: the chord in the scale is that of the strips
        start = c.gamma if warm and c.converged else None


def test_angles_beyond_the_table_are_flagged_strip_by_strip():
    c = stalling_wing(8).loads(arched_nodes(8), wind(0.8)).circulation
    assert np.array_equal(c.outside, (c.alpha < np.deg2rad(-15.0)) | (c.alpha > np.deg2rad(30.0)))
    assert c.outside.any()
