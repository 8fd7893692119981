"""Derivatives of wing and line loads along directions against differences, on every kind of wing."""

from dataclasses import replace

import numpy as np
import pytest

from aero import line_loads, line_loads_derivative
from aero.vortex_step import WingSensitivity
from aero.vortex_step.circulation import solve
from tests.aero.wings import arched_nodes, linear_wing, stalling_wing, wind

FLIP = np.array([1.0, -1.0, 1.0])
CHOICES = {
    "defaults": {},
    "strip theory": {"induction": False},
    "as Vortex-Step-Method": {"direction": "control", "circulation_speed": "far"},
    "thin plate": {"section_force": "normal"},
    "follower": {"follow": True},
    "camber": {"camber": True, "rows": 4},
}
# Fourth-order differences over 1e-5 m leave 1e-12 of the circulation over the step, and truncation: 1e-9 is found.
STEP, BOUND = 1e-5, 1e-7


def difference(f, step=STEP):
    """Fourth-order difference of f(s), arrays, at zero."""
    return (8.0 * (f(step) - f(-step)) - (f(2.0 * step) - f(-2.0 * step))) / (12.0 * step)


def directions(nodes, symmetric):
    v = np.random.default_rng(1).standard_normal(nodes.shape)
    if symmetric:
        grid = v.reshape(-1, 3, 3)
        v = 0.5 * (grid + grid[::-1] * FLIP).reshape(-1, 3)
    return v


def assert_close(found, expected):
    assert np.linalg.norm(found - expected) <= BOUND * np.linalg.norm(expected)


@pytest.mark.parametrize("choices", CHOICES.values(), ids=CHOICES)
@pytest.mark.parametrize("kind", [linear_wing, stalling_wing])
def test_wing_loads_answer_to_every_node_of_a_warped_wing(kind, choices):
    wing = kind(9, **({"cd": 0.1, "cm": -0.1} if kind is linear_wing else {}), **choices)
    nodes = arched_nodes(9, 0.02, np.random.default_rng(0), wing.grid.rows)
    air, v = wind(0.1), directions(nodes, False)
    loads = wing.loads(nodes, air)
    pressure, shear = WingSensitivity(wing, nodes, air, loads.circulation.gamma)(v)
    moved = lambda s: wing.loads(nodes + s * v, air, loads.circulation.gamma)  # noqa: E731
    assert_close(pressure, difference(lambda s: moved(s).pressure))
    if loads.shear is None:
        assert shear is None
    else:
        assert_close(shear, difference(lambda s: moved(s).shear))


@pytest.mark.parametrize("strips", [8, 9])
def test_half_a_wing_answers_as_the_whole_to_a_symmetric_direction(strips):
    wing, nodes, air = stalling_wing(strips), arched_nodes(strips), wind(0.1)
    v = directions(nodes, True)
    gamma = wing.loads(nodes, air).circulation.gamma
    half, whole = (WingSensitivity(wing, nodes, air, gamma, 0.0, symmetric)(v) for symmetric in (True, False))
    for a, b in zip(half, whole, strict=True):
        assert np.abs(a - b).max() <= 1e-10 * np.abs(b).max()  # 1e-12 of the circulation, times the condition


@pytest.mark.parametrize("symmetric", [True, False], ids=["half", "whole"])
def test_artificial_viscosity_changes_with_the_shape_too(symmetric):
    wing, nodes, air = stalling_wing(24), arched_nodes(24), wind(0.24)
    v = directions(nodes, symmetric)
    at = wing.placed(nodes, air, symmetric)
    used = 1.0
    start = wing.loads(nodes, air, None, symmetric).circulation.gamma[at.rows]

    def solved(s):
        """Loads with the viscosity kept: a solve of its own might do without it on a moved wing."""
        at = wing.placed(nodes + s * v, air, symmetric)
        at = replace(at, flow=at.flow.with_viscosity(used))
        circulation = solve(at.flow, start)
        assert circulation.converged
        assert circulation.viscosity == 0.0  # none but that which the flow has
        return wing.loaded(at, circulation)

    start = solved(0.0).circulation.gamma[at.rows]
    without = WingSensitivity(wing, nodes, air, solved(0.0).circulation.gamma, 0.0, symmetric)(v)
    found = WingSensitivity(wing, nodes, air, solved(0.0).circulation.gamma, used, symmetric)(v)
    for k, name in enumerate(("pressure", "shear")):
        expected = difference(lambda s, name=name: getattr(solved(s), name))
        assert_close(found[k], expected)
        assert np.linalg.norm(without[k] - expected) > 1e-3 * np.linalg.norm(expected)  # it matters here


def test_derivative_scales_with_the_direction_however_large_or_small():
    wing, nodes, air = stalling_wing(6), arched_nodes(6), wind(0.1)
    at = WingSensitivity(wing, nodes, air, wing.loads(nodes, air).circulation.gamma)
    v = directions(nodes, False)
    one = at(v)
    for factor in (1e-200, 1e-20, 1e20, 1e200):
        for a, b in zip(at(factor * v), one, strict=True):
            assert np.abs(a / factor - b).max() <= 1e-12 * np.abs(b).max()  # rounding
    assert not any(a.any() for a in at(0.0 * v))


def test_line_loads_answer_to_the_ends_also_of_lines_along_the_wind():
    rng = np.random.default_rng(2)
    ends, v = rng.standard_normal((6, 2, 3)), rng.standard_normal((6, 2, 3))
    air = np.full(6, 0.002), np.array([12.0, 0.0, 3.0]), 1.2, 1.1, 0.02
    assert_close(line_loads_derivative(ends, v, *air), difference(lambda s: line_loads(ends + s * v, *air)))
    ends[0] = [[0.0, 0.0, 0.0], [4.0, 0.0, 1.0]]  # no load across it, and none to first order
    assert np.abs(line_loads_derivative(ends, v, *air)[0]).max() <= 1e-14 * 0.002 * 12.0**2
