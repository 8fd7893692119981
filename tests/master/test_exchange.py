"""The coupled map of participants: orders, chains and rings, substeps, what it counts, and what it refuses."""

import time

import numpy as np
import pytest

from master.coupling.acceleration import IQNILS, ConstantRelaxation
from master.coupling.exchange import Connection, CoupledStepFailed, Exchange, StateSnapshot
from master.coupling.fixed_point import fixed_point
from master.coupling.march import march
from tests.master.toys import Faulty, Mass, Spring, Toy

K, M = 4.0, 1.0


class Law(Toy):
    """out = slope tanh(in) + offset, (n,), without memory."""

    def __init__(self, name, slope=0.5, offset=0.0, n=2, faults=None):
        super().__init__(name, {"in": ("input", np.zeros(n)), "out": ("output", np.zeros(n))}, faults)
        self.slope, self.offset = slope, offset

    def advance(self, t, dt):
        self.values["out"] = self.slope * np.tanh(self.values["in"]) + self.offset


def joined(*pairs):
    """Connections out -> in."""
    return [Connection(a, "out", b, "in") for a, b in pairs]


def laws(*names):
    return {n: Law(n, slope=-1.5 + 0.7 * k, offset=0.3 + 0.1 * k) for k, n in enumerate(names)}


def solution(participants, ring):
    """What the first of a ring of laws sends, by repeated averaging of the scalar map."""
    x = 0.0
    for _ in range(500):
        y = x
        for name in ring:
            y = participants[name].slope * np.tanh(y) + participants[name].offset
        x = 0.5 * (x + y)
    return x


@pytest.mark.parametrize("order", ["serial", "parallel"])
@pytest.mark.parametrize("sequence", ["abc", "acb", "cab"])
def test_three_in_a_ring_have_one_solution_in_every_order(order, sequence):
    participants = laws(*"abc")
    exchange = Exchange({n: participants[n] for n in sequence}, joined(("a", "b"), ("b", "c"), ("c", "a")))
    scheme = IQNILS()
    G = lambda x: exchange.evaluate(x, order)  # noqa: E731
    result = fixed_point(G, exchange.present(order), scheme, atol=1e-12, fields=exchange.fields(order))
    assert result.status == "converged"
    # a sends what has gone round: x = a(c(b(x)))
    expected = solution(participants, "bca")
    # the residual over |1 - slope| > 0.5 of the round
    assert participants["a"].get("out") == pytest.approx(np.full(2, expected), abs=1e-10)
    unknowns = 3 if order == "parallel" else {"abc": 1, "acb": 2, "cab": 1}[sequence]
    assert len(exchange.fields(order)) == unknowns


def test_in_a_chain_nothing_is_sent_back_and_one_evaluation_solves_it():
    participants = laws(*"abc")
    participants["a"].values["in"][:] = 0.7
    exchange = Exchange(participants, joined(("a", "b"), ("b", "c")), rollback=True)
    assert exchange.fields("serial") == {}
    result = march(exchange, IQNILS(), 3.0)
    assert result.status == "converged"
    assert result.evaluations == 3
    y = 0.7
    for law in participants.values():
        y = law.slope * np.tanh(y) + law.offset
    assert participants["c"].get("out") == pytest.approx(np.full(2, y), abs=1e-15)


def test_a_chain_in_parallel_order_takes_its_length_explicitly():
    participants = laws(*"abc")
    exchange = Exchange(participants, joined(("a", "b"), ("b", "c")), rollback=True)
    x = exchange.present("parallel")
    result = fixed_point(lambda x: exchange.evaluate(x, "parallel"), x, ConstantRelaxation(1.0), atol=1e-14)
    assert (result.status, result.iterations) == ("converged", 3)  # two for the values to go through, one to see it


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_a_participant_may_be_connected_to_itself(order):
    exchange = Exchange({"a": Law("a", -1.5, 0.4)}, joined(("a", "a")), rollback=True)
    result = march(exchange, IQNILS(), 2.0, order=order, rtol=1e-12)
    assert result.status == "converged"
    # the residual over 1 - slope > 1
    assert result.x == pytest.approx(-1.5 * np.tanh(result.x) + 0.4, abs=1e-11)


def test_one_output_may_go_to_several_and_counts_once():
    participants = laws(*"abc")
    exchange = Exchange(participants, joined(("c", "a"), ("c", "b"), ("a", "c")))
    assert list(exchange.fields("serial")) == ["c.out"]
    assert exchange.fields("parallel") == {"c.out": slice(0, 2), "a.out": slice(2, 4)}
    exchange.evaluate(np.array([0.2, -0.1]))
    assert np.array_equal(participants["a"].get("in"), participants["b"].get("in"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"connections": []}, "no connections"),
        ({"connections": joined(("a", "x"), ("b", "a"))}, "no participant 'x'"),
        ({"connections": joined(("x", "b"))}, "no participant 'x'"),
        ({"connections": [Connection("a", "in", "b", "in")]}, "a has no output 'in'; it has: out"),
        ({"connections": [Connection("a", "out", "b", "out")]}, "b has no input 'out'; it has: in"),
        ({"connections": [Connection("a", "none", "b", "in")]}, "a has no output 'none'"),
        ({"connections": joined(("a", "b"), ("a", "b"))}, "has a source already"),
        ({"connections": joined(("a", "long"))}, r"has shape \(2,\)"),
        ({"substeps": {"x": 2}}, "no participant 'x'"),
        ({"substeps": {"a": 0}}, "whole number of substeps"),
        ({"substeps": {"a": 1.5}}, "whole number of substeps"),
        ({"substeps": {"a": float("nan")}}, "whole number of substeps"),
        ({"substeps": {"a": float("inf")}}, "whole number of substeps"),
        ({"memoryless": ["x"]}, "no participant 'x'"),
        ({"dt": 0.0}, "above zero"),
        ({"dt": float("nan")}, "above zero"),
        ({"interpolation": "cubic"}, "linear or constant"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_sentence(change, says):
    participants = {**laws(*"ab"), "long": Law("long", n=5)}
    options = {"connections": joined(("a", "b"), ("b", "a"))} | change
    with pytest.raises(ValueError, match=says + r"(.|\n)*\.$") as caught:
        Exchange(participants, **options)
    assert "\n" not in str(caught.value)


def oscillator(dt, substeps, interpolation, mass=None):
    participants = {"spring": Spring(K), "mass": mass or Mass(M, forces=-K)}
    connections = [Connection("spring", "f", "mass", "f"), Connection("mass", "x", "spring", "x")]
    return Exchange(participants, connections, dt, substeps=substeps, interpolation=interpolation, rollback=True)


@pytest.mark.parametrize(("interpolation", "order"), [("linear", 2.0), ("constant", 1.0)])
def test_a_subcycled_mass_converges_with_the_order_of_the_interpolation_of_its_input(interpolation, order):
    errors = []
    for dt in (0.1, 0.05, 0.025):
        exchange = oscillator(dt, {"mass": 5}, interpolation)
        result = march(exchange, IQNILS(), 1.0, rtol=1e-12, atol=1e-14)
        assert result.status == "converged"
        errors.append(abs(float(exchange.participants["mass"].get("x")[0]) - np.cos(2.0)))
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    assert observed == pytest.approx(order, abs=0.15)  # the next term of the error expansion at dt = 0.1


def test_substeps_get_the_inputs_and_times_of_a_ramp():
    seen = []

    class Seen(Law):
        def advance(self, t, dt):
            seen.append((t, dt, float(self.values["in"][0])))
            super().advance(t, dt)

    for interpolation in ("linear", "constant"):
        participants = {"a": Law("a", n=1), "b": Seen("b", n=1)}
        participants["a"].values["out"][:] = 1.0
        exchange = Exchange(
            participants, joined(("a", "b"), ("b", "a")), 0.5, 2.0, {"b": 4}, interpolation, rollback=True
        )  # fmt: skip
        exchange.open()
        participants["a"].offset = 3.0
        exchange.evaluate(np.zeros(1))
        exchange.abandon()
    ramp, steps = seen[:4], seen[4:]
    # binary fractions are exact
    assert ramp == [(2.0, 0.125, 1.5), (2.125, 0.125, 2.0), (2.25, 0.125, 2.5), (2.375, 0.125, 3.0)]
    assert [value for *_, value in steps] == [3.0] * 4


def test_evaluations_products_and_seconds_are_counted():
    class Slow(Law):
        offers_derivatives = True

        def advance(self, t, dt):
            time.sleep(0.01)
            super().advance(t, dt)

        def directional_derivative(self, changes):
            return {"out": self.slope / np.cosh(self.values["in"]) ** 2 * changes["in"]}

    a, b = Slow("a"), Slow("b", slope=0.2)
    exchange = Exchange({"a": a, "b": b}, joined(("a", "b"), ("b", "a")))
    x = np.array([0.3, -0.2])
    for _ in range(3):
        exchange.evaluate(x)
    product = exchange.derivative(np.array([1.0, 0.0]))
    assert (exchange.evaluations, exchange.products) == (3, 2)
    assert exchange.time == 3.0  # without rollback time advances with every evaluation
    assert 0.03 <= exchange.seconds["a"] < 3.0  # never shorter than the sleeps
    h = 1e-6
    d = np.array([h, 0.0])
    difference = (exchange.evaluate(x + d) - exchange.evaluate(x - d)) / (2.0 * h)
    assert product == pytest.approx(difference, abs=1e-9)  # h^2 and rounding over h


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_the_derivative_of_a_ring_is_that_of_its_map(order):
    class Smooth(Law):
        offers_derivatives = True

        def directional_derivative(self, changes):
            return {"out": self.slope / np.cosh(self.values["in"]) ** 2 * changes["in"]}

    participants = {n: Smooth(n, 0.4 + 0.2 * k) for k, n in enumerate("abc")}
    exchange = Exchange(participants, joined(("a", "b"), ("b", "c"), ("c", "a"), ), rollback=True)  # fmt: skip
    rng = np.random.default_rng(0)
    x = rng.standard_normal(exchange.present(order).size)
    v = rng.standard_normal(x.size)
    h = 1e-6
    difference = (exchange.evaluate(x + h * v, order) - exchange.evaluate(x - h * v, order)) / (2.0 * h)
    exchange.evaluate(x, order)
    assert exchange.derivative(v, order) == pytest.approx(difference, abs=1e-9)  # h^2 and rounding over h


def test_a_participant_without_derivatives_is_named():
    exchange = Exchange(laws(*"ab"), joined(("a", "b"), ("b", "a")))
    with pytest.raises(ValueError, match=r"^participant a offers no directional derivatives.*\.$"):
        exchange.require_derivatives()


class Unsaved(Law):
    """A law whose save fails."""

    def save(self):
        raise RuntimeError("no memory left")


class Lost(Law):
    """A law whose restore fails."""

    def restore(self, state):
        raise ValueError("the state is gone.")


def test_a_save_that_fails_frees_what_the_others_have_saved():
    a, b = Law("a"), Unsaved("b")
    exchange = Exchange({"a": a, "b": b}, joined(("a", "b"), ("b", "a")), rollback=True)
    for attempt in (exchange.save, exchange.open, lambda: StateSnapshot(exchange)):
        with pytest.raises(CoupledStepFailed, match="participant b could not save its state: no memory left"):
            attempt()
        assert a.alive == 0


def test_an_interrupted_save_frees_what_the_others_have_saved():
    class Interrupted(Law):
        def save(self):
            raise KeyboardInterrupt

    a = Law("a")
    exchange = Exchange({"a": a, "b": Interrupted("b")}, joined(("a", "b"), ("b", "a")), rollback=True)
    with pytest.raises(KeyboardInterrupt):
        exchange.open()
    assert a.alive == 0


def test_one_participant_that_cannot_free_does_not_keep_the_states_of_the_others():
    class Stuck(Law):
        def free(self, state):
            raise RuntimeError("it is closed")

    a, c = Law("a"), Law("c")
    exchange = Exchange({"a": a, "b": Stuck("b"), "c": c}, joined(("a", "b"), ("b", "c"), ("c", "a")), rollback=True)
    exchange.open()
    exchange.abandon()
    assert (a.alive, c.alive) == (0, 0)


def test_a_restore_that_fails_ends_in_a_status():
    a, b = Law("a"), Lost("b")
    exchange = Exchange({"a": a, "b": b}, joined(("a", "b"), ("b", "a")), rollback=True)
    result = march(exchange, IQNILS(), 2.0)
    assert result.status == "diverged"
    assert "participant b could not restore its state: the state is gone" in result.message
    assert (a.alive, b.alive) == (0, 0)


def test_a_failed_save_ends_a_run_with_a_status():
    a = Law("a")
    exchange = Exchange({"a": a, "b": Unsaved("b")}, joined(("a", "b"), ("b", "a")), rollback=True)
    result = march(exchange, IQNILS(), 2.0)
    assert result.status == "diverged"
    assert "could not save" in result.message
    assert result.message.endswith(".")
    assert a.alive == 0


def test_a_participant_that_ended_names_its_reason():
    a, b = Law("a"), Faulty(Law("b"), {3: "dead"})
    exchange = Exchange({"a": a, "b": b}, joined(("a", "b"), ("b", "a")), rollback=True)
    result = march(exchange, IQNILS(), 5.0)
    assert result.status == "diverged"
    assert "fmi2Fatal" in " ".join(message for _, message in result.steps.messages)
    assert a.alive == 0
