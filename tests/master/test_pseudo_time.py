"""Coupled maps that jump between equilibria of the structure, and the steps in pseudo-time that find a stable one."""

import numpy as np
import pytest

from interface import Variable
from master.coupling.acceleration import IQNILS, ConstantRelaxation
from master.coupling.equilibrium import Coupling, solve
from master.coupling.participants import InProcessParticipant
from master.coupling.stability import static_stability
from scenes.cores.core import Core, Result, Solver
from structural import Assembly, Chains, Loads, LoadSensitivity, Structure, equilibrium

STIFFNESS, SLOPE, CUBIC = 2.0, 5.0, 1.0  # N/m, N/m, N/m^3


class Bistable(Solver):
    """A mass on a spring of STIFFNESS that loads which follow it, SLOPE x, overcome, and the load of the flow. By
    itself it is unstable, and where it is not held back it is thrown from one side to the other.
    """

    name = "bistable"
    variables = (
        Variable("pressure", (1,), unit="N"),
        Variable("pseudo_damping", unit="N/m", causality="parameter", variability="tunable", minimum=0.0),
        Variable("displacement", (1, 3), unit="m", causality="output"),
        Variable("newton_iterations", causality="output"),
        Variable("imbalance_before_step", unit="N", causality="output"),
    )

    def begin(self, values):
        return Result({"displacement": np.array([[0.3, 0.0, 0.0]])}, 0.3)

    def must_step(self, values, state, t, dt):
        return True

    def step(self, values, state, first, t, dt):
        load, damping = float(values["pressure"][0]), float(values["pseudo_damping"])
        tangent = STIFFNESS - SLOPE
        before = tangent * state - load
        if damping > 0.0:
            x, spent = (load + damping * state) / (tangent + damping), 2.0
        else:
            x, spent = (4.0 if state < 0.0 else -4.0), 500.0
        out = {"displacement": np.array([[x, 0.0, 0.0]]), "newton_iterations": spent}
        return Result(out | {"imbalance_before_step": abs(before)}, x)


class Restoring(Solver):
    """A flow with the load 1 - (SLOPE + CUBIC x^2) x: together with the structure it is stable."""

    name = "restoring"
    variables = (
        Variable("displacement", (1, 3), unit="m"),
        Variable("pressure", (1,), unit="N", causality="output"),
    )

    def step(self, values, state, first, t, dt):
        x = float(values["displacement"][0, 0])
        return Result({"pressure": np.array([1.0 - (SLOPE + CUBIC * x * x) * x])})


def _coupling():
    return Coupling(InProcessParticipant(Core(Bistable())), InProcessParticipant(Core(Restoring())))


def test_a_map_that_jumps_comes_to_the_stable_equilibrium_in_pseudo_time():
    """STIFFNESS x = 1 - CUBIC x^3, stable, though the structure by itself is not under the loads there."""
    coupling = _coupling()
    result = solve(coupling, IQNILS())
    x = result.displacement[0, 0]
    assert result.status == "converged", result.message
    assert STIFFNESS * x + CUBIC * x**3 == pytest.approx(1.0, abs=0.01)  # force_tolerance
    assert result.residual_N <= 0.01
    assert "led on in pseudo-time" in str(result.recoveries[-1])
    assert static_stability(coupling, result.displacement).statically_stable is None
    again = solve(coupling, IQNILS())  # begins without damping
    assert again.history[0]["structural.newton_iterations"] == 500.0


def test_constant_relaxation_ends_as_it_is():
    assert solve(_coupling(), ConstantRelaxation(0.5)).status == "stalled"


def _strut():
    """A spring of k = 100 N/m from a support to a node, with a second one across."""
    nodes = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    rows = np.array([[0, 1], [2, 1], [3, 1]])
    springs = Chains(rows, np.ones(3), np.array([100.0, 1.0, 1.0]), np.ones(3, bool))
    return Structure(nodes, np.repeat(np.array([True, False, True, True])[:, None], 3, axis=1), (springs,))


def test_a_damped_step_goes_from_its_start_as_far_as_what_is_left_of_the_force_says():
    s = _strut()
    force = np.array([[0.0] * 3, [0.1, 0.0, -2.0], [0.0] * 3, [0.0] * 3])
    free = equilibrium(Assembly(s), Loads(force), s.nodes, 1e-10)
    x, lengths = s.nodes, []
    for _ in range(60):
        step = equilibrium(Assembly(s), Loads(force), x, 1e-10, damping=1.0)
        assert step.converged
        here = equilibrium(Assembly(s), Loads(force), step.x, 1e-10, max_iterations=0)
        lengths.append(np.linalg.norm(step.x - x))
        # implicit Euler: what is out of balance at the end of the step holds back 1 N/m; solved to 1e-10 N
        assert here.residuals[0] == pytest.approx(lengths[-1], abs=1e-9)
        x = step.x
    assert lengths[-1] < 1e-9
    np.testing.assert_allclose(x, free.x, atol=1e-8)  # 1e-10 N over the least stiffness, some 0.1 N/m


def test_the_derivative_of_a_damped_step_is_that_of_the_damped_step():
    s, h = _strut(), 1e-5
    force = np.array([[0.0] * 3, [0.1, 0.05, -2.0], [0.0] * 3, [0.0] * 3])
    change = np.array([[0.0] * 3, [0.3, -0.2, 0.5], [0.0] * 3, [0.0] * 3])
    steps = [equilibrium(Assembly(s), Loads(force + a * h * change), s.nodes, 1e-12, damping=3.0).x for a in (-1, 0, 1)]
    exact = LoadSensitivity(Assembly(s), Loads(force), steps[1], damping=3.0)(Loads(change))
    # central differences: h^2 and 1e-12 N / h
    np.testing.assert_allclose((steps[2] - steps[0]) / (2.0 * h), exact, atol=1e-6)
