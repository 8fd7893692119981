"""The system of the panel method and its solution: GMRES, what is kept between solves, halves and rigid motions."""

from dataclasses import replace

import numpy as np
import pytest

from aero.panel import solver
from aero.panel.bodies import Body
from aero.panel.solver import PanelSolver, gmres, rigid_motion
from interface import StepFailed
from interface.vectors import rotated, rotation
from tests.aero.closed_wings import direction, wing

SPEED = 10.0


def body_of(surface):
    return Body.of(surface.nodes, surface.panels, surface.trailing_edges)


def same(one, other):
    """Whether two solutions are the same to the bit, with the states they leave."""
    (a, left_a), (b, left_b) = one, other
    fields = ("doublets", "nodes", "factored", "direction")
    return (
        np.array_equal(a.doublets, b.doublets)
        and (a.iterations, a.factored, a.residual) == (b.iterations, b.factored, b.residual)
        and all(np.array_equal(getattr(left_a, f), getattr(left_b, f)) for f in fields)
        and left_a.spent == left_b.spent
    )


def bent(nodes, by):
    """Tips up by so many m, and a little twisted."""
    y = nodes[:, 1:2]
    return nodes + by * np.concatenate([0.0 * y, 0.0 * y, (y / 3.0) ** 2 + 0.1 * nodes[:, :1] * y], axis=1)


def test_gmres_solves_what_a_direct_solver_solves():
    rng = np.random.default_rng(0)
    a = np.eye(60) + 0.3 * rng.standard_normal((60, 60)) / np.sqrt(60)
    b = rng.standard_normal(60)
    found = gmres(lambda x: a @ x, lambda x: x, b, np.zeros(60), 1e-12, 60)
    assert found.converged
    np.testing.assert_allclose(found.x, np.linalg.solve(a, b), rtol=0, atol=1e-11)  # 1e-12 times the condition, 3
    exact = np.linalg.inv(a)
    assert gmres(lambda x: a @ x, lambda x: exact @ x, b, np.zeros(60), 1e-10, 60).iterations == 1
    assert gmres(lambda x: a @ x, lambda x: x, b, found.x, 1e-10, 60).iterations == 0
    stopped = gmres(lambda x: a @ x, lambda x: x, b, np.zeros(60), 1e-12, 3)
    assert not stopped.converged
    assert stopped.iterations == 3


def test_a_right_hand_side_of_zero_has_no_doublets():
    assert np.all(gmres(lambda x: 2.0 * x, lambda x: x, np.zeros(5), np.ones(5), 1e-10, 9).x == 0.0)


def test_one_half_gives_the_strengths_of_the_whole_wing():
    surface, d = wing(), direction(0.08)
    whole = body_of(surface)
    half = whole.half(surface.nodes)
    all_of_it, _ = PanelSolver(whole).solve(surface.nodes, SPEED * d, d)
    one, _ = PanelSolver(half.body).solve(surface.nodes, SPEED * d, d)
    scale = np.abs(all_of_it.doublets).max()
    np.testing.assert_allclose(half.whole(one.doublets), all_of_it.doublets, rtol=0, atol=1e-8 * scale)  # both to 1e-10
    np.testing.assert_allclose(half.whole_strips(one.jumps), all_of_it.jumps, rtol=0, atol=1e-8 * scale)


@pytest.mark.parametrize("symmetric", [True, False])
def test_a_rigid_motion_keeps_the_columns_of_the_body_and_its_answer(symmetric):
    surface = wing()
    body = body_of(surface)
    body = body.half(surface.nodes).body if symmetric else body
    kept, turn = PanelSolver(body), rotation(np.array([0.0, 0.2, 0.0]) if symmetric else np.array([0.1, 0.2, -0.3]))
    d = direction(0.08)
    first, state = kept.solve(surface.nodes, SPEED * d, d)
    matrix = kept._columns
    moved = surface.nodes @ turn.T + [3.0, 0.0 if symmetric else 1.0, -2.0]
    found, after = kept.solve(moved, SPEED * turn @ d, turn @ d, state)
    assert kept._columns is matrix
    assert np.array_equal(after.nodes, state.nodes)
    np.testing.assert_allclose(found.doublets, first.doublets, rtol=0, atol=1e-8 * np.abs(first.doublets).max())
    fresh, _ = PanelSolver(body).solve(moved, SPEED * turn @ d, turn @ d)
    np.testing.assert_allclose(found.doublets, fresh.doublets, rtol=0, atol=1e-8 * np.abs(first.doublets).max())


def test_only_rigid_motions_are_taken_for_such():
    nodes, used = wing().nodes, np.arange(len(wing().nodes))
    turn = rotation(np.array([0.0, 0.7, 0.0]))
    for upright in (True, False):
        found = rigid_motion(nodes, nodes @ turn.T + [1.0, 0.0, 2.0], used, upright)
        np.testing.assert_allclose(found.turn, turn, atol=1e-13)
        np.testing.assert_allclose(found.back(nodes @ turn.T + [1.0, 0.0, 2.0]), nodes, atol=1e-13)
        assert rigid_motion(nodes, bent(nodes, 1e-6), used, upright) is None
        assert rigid_motion(nodes, nodes * [1.0, -1.0, 1.0], used, upright) is None
        assert rigid_motion(nodes, 1.001 * nodes, used, upright) is None
        assert rigid_motion(nodes, nodes.copy(), used, upright).none
    assert rigid_motion(nodes, nodes + np.array([0.0, 1.0, 0.0]), used, True) is None  # off the plane of symmetry


def flight(surface):
    """Shapes and winds as a coupled run has them: the wind turns, the wing pitches, then bends."""
    nodes, steps = surface.nodes, []
    for i in range(7):
        d = direction(0.05 + 0.01 * i)
        steps.append((nodes, SPEED * d, d))
        nodes = rotated(nodes, 0.05, np.zeros(3)) if i == 1 else bent(nodes, 0.02 * i) if i > 1 else nodes
    return steps


@pytest.mark.parametrize("worth", [40, 1])
def test_what_is_kept_changes_no_bit_of_what_a_state_leads_to(worth, monkeypatch):
    """Whether the factors that a state names are still there, were replaced, or were never there."""
    monkeypatch.setattr(solver, "WORTH", worth)  # 1: factored anew in most steps
    surface = wing()
    half = body_of(surface).half(surface.nodes).body
    steps, kept, state, states, found = flight(surface), PanelSolver(half), None, [], []
    for step in steps:
        states.append(state)
        found.append(kept.solve(*step, state))
        state = found[-1][1]
    assert any(f.factored for f, _ in found[1:]) == (worth == 1)
    for i in (3, 5, 1, 6, 0, 4):  # going back and forth with one solver, and with one that has nothing
        assert same(kept.solve(*steps[i], states[i]), found[i]), i
        assert same(PanelSolver(half).solve(*steps[i], states[i]), found[i]), i


def test_old_factors_give_the_answer_of_new_ones():
    surface = wing()
    steps, kept, state = flight(surface), PanelSolver(body_of(surface)), None
    for step in steps:
        found, state = kept.solve(*step, state)
        assert found.residual <= solver.TOLERANCE
    fresh, _ = PanelSolver(body_of(surface)).solve(*steps[-1])
    assert state.spent > 0
    assert not found.factored
    np.testing.assert_allclose(found.doublets, fresh.doublets, rtol=0, atol=1e-7 * np.abs(fresh.doublets).max())


def test_factors_of_another_shape_altogether_are_replaced_when_they_do_not_lead_there(monkeypatch):
    monkeypatch.setattr(solver, "WORTH", 3)
    surface, d = wing(), direction(0.08)
    kept = PanelSolver(body_of(surface))
    _, state = kept.solve(surface.nodes, SPEED * d, d)
    other = bent(surface.nodes, 1.5) * [1.0, 1.0, 3.0]
    found, after = kept.solve(other, SPEED * d, d, state)
    assert found.factored
    assert np.array_equal(after.factored, other)
    fresh, _ = PanelSolver(body_of(surface)).solve(other, SPEED * d, d)
    np.testing.assert_allclose(found.doublets, fresh.doublets, rtol=0, atol=1e-7 * np.abs(fresh.doublets).max())


def test_a_stream_given_at_every_panel_is_that_given_once():
    surface, d = wing(), direction(0.08, 0.05)
    uniform, _ = PanelSolver(body_of(surface)).solve(surface.nodes, SPEED * d, d)
    each, _ = PanelSolver(body_of(surface)).solve(surface.nodes, np.tile(SPEED * d, (len(surface.panels), 1)), d)
    np.testing.assert_allclose(each.doublets, uniform.doublets, rtol=0, atol=1e-7 * np.abs(uniform.doublets).max())


def test_a_state_of_another_shape_of_the_same_wing_is_only_a_first_guess():
    surface, d = wing(), direction(0.08)
    kept = PanelSolver(body_of(surface))
    _, state = kept.solve(surface.nodes, SPEED * d, d)
    wrong = replace(state, doublets=state.doublets * -3.0)
    found, _ = kept.solve(surface.nodes, SPEED * d, d, wrong)
    right, _ = kept.solve(surface.nodes, SPEED * d, d)
    np.testing.assert_allclose(found.doublets, right.doublets, rtol=0, atol=1e-7 * np.abs(right.doublets).max())


def test_more_panels_than_memory_holds_are_refused_with_number_and_size(monkeypatch):
    surface, d = wing(), direction(0.08)
    monkeypatch.setattr(solver, "free_memory", lambda: 1.5e8)
    with pytest.raises(StepFailed, match=r"^390 panels need 0\.\d+ GB of memory and 0\.15 GB are free; .*\.$"):
        PanelSolver(body_of(surface)).solve(surface.nodes, SPEED * d, d)
