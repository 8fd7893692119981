"""Newton-Krylov in transient runs: derivatives are those at the point that is left, also after a failed evaluation."""

import numpy as np
import pytest

from master.coupling import Connection, Exchange, scheme
from master.coupling.march import march
from tests.master.toys import Mass, Spring

DT = 0.1


class Tangents:
    """Directional derivatives of the oscillator's parts by their closed forms; they count their last state."""

    offers_derivatives = True


class HardSpring(Tangents, Spring):
    def directional_derivative(self, changes):
        x = self.values["x"]
        return {"f": (-self.k - 3.0 * self.c * x**2) * changes["x"]}


class TangentMass(Tangents, Mass):
    def directional_derivative(self, changes):
        return {"x": 0.25 * DT**2 / self.m * changes["f"]}  # trapezoidal rule: half of the force, half of dt^2


def run(name, faults=None):
    spring = HardSpring(400.0, 300.0, faults=faults)
    mass = TangentMass(1.0, forces=-700.0)
    connections = [Connection("spring", "f", "mass", "f"), Connection("mass", "x", "spring", "x")]
    exchange = Exchange({"spring": spring, "mass": mass}, connections, dt=DT, rollback=True)
    result = march(exchange, scheme(name, exchange), 1.0, rtol=1e-11, atol=1e-13)
    return result, mass, spring


def test_the_stiff_oscillator_is_that_of_other_schemes_in_fewer_evaluations():
    newton, mass, _ = run("newton-krylov")
    other, reference, _ = run("iqn-ils")
    assert newton.status == other.status == "converged"
    assert mass.get("x") == pytest.approx(reference.get("x"), rel=1e-8)  # ten steps to 1e-11, grown by their stiffness
    assert np.mean(newton.steps.iterations) <= np.mean(other.steps.iterations)


@pytest.mark.parametrize("at", [5, 6, 7])
def test_a_failed_evaluation_is_overcome_and_all_states_are_freed(at):
    sound, reference, _ = run("newton-krylov")
    result, mass, spring = run("newton-krylov", {at: "nan", at + 1: "raise"})
    assert sound.status == result.status == "converged"
    assert result.steps.count("recovered") == 1
    assert mass.get("x") == pytest.approx(reference.get("x"), rel=1e-8)  # as above
    assert mass.alive == spring.alive == 0
