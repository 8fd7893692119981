"""What a connection does on the way, and what time an exchange keeps."""

import numpy as np
import pytest

from master.coupling.acceleration import IQNILS
from master.coupling.exchange import Connection, Exchange, StateSnapshot
from master.coupling.march import march
from tests.master.toys import Mass, Spring


class Tangent(Spring):
    """The spring with its derivative."""

    offers_derivatives = True

    def directional_derivative(self, changes):
        return {"f": -(self.k + 3.0 * self.c * self.values["x"] ** 2) * changes["x"]}


def ring(factor, **options):
    """Two springs that feed each other: x -> -2 x - x^3 -> factor -> -0.5 x."""
    participants = {"a": Tangent(2.0, c=1.0), "b": Tangent(0.5)}
    connections = [Connection("a", "f", "b", "x", factor), Connection("b", "f", "a", "x")]
    return Exchange(participants, connections, **options)


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_the_derivative_goes_through_factors_as_the_values_do(order):
    exchange = ring(-3.0)
    n = exchange.present(order).size
    x, v, h = np.linspace(0.3, 0.4, n), np.linspace(1.0, -0.5, n), 1e-5
    difference = (exchange.evaluate(x + h * v, order) - exchange.evaluate(x - h * v, order)) / (2.0 * h)
    exchange.evaluate(x, order)
    assert exchange.derivative(v, order) == pytest.approx(difference, rel=1e-8)  # h^2 and rounding / h


def oscillator(dt, factor=1.0, **options):
    """A mass of 1 kg on a spring of 4 / factor N/m whose force arrives `factor` times."""
    participants = {"spring": Spring(4.0 / factor), "mass": Mass(1.0, forces=-4.0)}
    connections = [Connection("spring", "f", "mass", "f", factor), Connection("mass", "x", "spring", "x")]
    return Exchange(participants, connections, dt=dt, rollback=True, **options)


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_an_offset_arrives_and_leaves_the_derivative_as_it_is(order):
    participants = {"a": Tangent(2.0, c=1.0), "b": Tangent(0.5)}
    connections = [Connection("a", "f", "b", "x", -3.0, 273.15), Connection("b", "f", "a", "x")]
    exchange = Exchange(participants, connections)
    x = np.full(exchange.present(order).size, 0.3)
    exchange.evaluate(x, order)
    sent = exchange.participants["a"].get("f") if order == "serial" else x[0]
    assert exchange.participants["b"].values["x"] == -3.0 * sent + 273.15
    found, plain = exchange.derivative(np.ones_like(x), order), ring(-3.0)
    plain.evaluate(x, order)
    assert np.array_equal(found, plain.derivative(np.ones_like(x), order))


@pytest.mark.parametrize("substeps", [1, 3])
def test_a_factor_and_its_inverse_in_the_participant_cancel_also_where_inputs_are_ramps(substeps):
    found = []
    for factor in (1.0, -8.0):  # a power of two, so that nothing is rounded
        exchange = oscillator(0.1, factor, substeps={"mass": substeps})
        assert march(exchange, IQNILS(), 1.0, rtol=1e-10).status == "converged"
        found.append(exchange.participants["mass"].get("x"))
    assert found[0] == found[1]


def test_the_time_of_a_long_run_is_not_summed_up():
    exchange = oscillator(0.1)
    for _ in range(30000):
        exchange.open()
        exchange.accept()
    assert exchange.time == 30000 * 0.1  # 0.1 added up 30000 times is off by 1e-8


def test_an_anchor_brings_back_the_time_of_its_states_too():
    exchange = Exchange(ring(1.0).participants, ring(1.0).connections, dt=0.5)
    anchor = StateSnapshot(exchange)
    exchange.evaluate(exchange.present())
    anchor.mark()
    exchange.evaluate(exchange.present())
    assert exchange.time == 1.0
    anchor.restore()
    assert exchange.time == 0.5
    anchor.close()


def test_what_is_sent_back_goes_on_to_later_participants_as_it_is_by_now():
    participants = {"first": Tangent(0.5), "middle": Tangent(3.0, c=1.0), "last": Tangent(2.0)}
    connections = [
        Connection("middle", "f", "first", "x"),
        Connection("first", "f", "middle", "x"),
        Connection("middle", "f", "last", "x"),
    ]
    exchange = Exchange(participants, connections)
    x, v, h = np.array([0.3]), np.array([1.0]), 1e-5
    exchange.evaluate(x)
    middle = participants["middle"].get("f")
    assert participants["last"].get("f") == -2.0 * middle  # not of x
    difference = (exchange.evaluate(x + h * v) - exchange.evaluate(x - h * v)) / (2.0 * h)
    exchange.evaluate(x)
    assert exchange.derivative(v) == pytest.approx(difference, rel=1e-8)  # h^2 and rounding / h
