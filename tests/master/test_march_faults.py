"""Transient runs that meet faults: what recovers, what ends how, and that no saved state is left behind."""

import itertools

import numpy as np
import pytest

from fmus.builder import archive
from master.coupling import Connection, Exchange, FmuParticipant
from master.coupling.acceleration import IQNILS, IQNIMVJ, Aitken, ConstantRelaxation
from master.coupling.march import march
from tests.fmus.toy_fmu import Toy as Core
from tests.fmus.toy_fmu import ToyFmu
from tests.master.toys import Mass, Spring

K, M, STEPS, DT = 4.0, 1.0, 12, 0.05
SCHEMES = {
    "explicit": lambda: None,
    "relaxation": lambda: ConstantRelaxation(0.9),
    "aitken": Aitken,
    "iqn-ils": IQNILS,
    "iqn-imvj": IQNIMVJ,
}
TOLERANCES = {"rtol": 1e-10, "atol": 1e-12}


def oscillator(faults=None, where="mass"):
    """A mass on a spring that hardens; `faults` of the one or the other."""
    spring = Spring(K, 1.0, faults=faults if where == "spring" else None)
    mass = Mass(M, forces=-K - 1.0, faults=faults if where == "mass" else None)
    connections = [Connection("spring", "f", "mass", "f"), Connection("mass", "x", "spring", "x")]
    return Exchange({"spring": spring, "mass": mass}, connections, DT, rollback=True)


def alive(exchange):
    return [p.alive for p in exchange.participants.values()]


def run(scheme, faults=None, where="mass", **options):
    exchange = oscillator(faults, where)
    found = march(exchange, SCHEMES[scheme](), STEPS * DT, **{**TOLERANCES, **options})
    assert alive(exchange) == [0, 0]
    return found, exchange


def step_of(evaluation, iterations):
    """Number, from 0 on, of the step that an evaluation belongs to."""
    return int(np.searchsorted(np.cumsum(iterations), evaluation))


@pytest.mark.parametrize("fault", ["nan", "raise", "discard"])
@pytest.mark.parametrize("where", ["mass", "spring"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_fault_that_comes_once_is_overcome_and_named(scheme, where, fault):
    sound, _ = run(scheme)
    assert sound.status == "converged"
    total = sound.evaluations
    for at in (1, 2, total // 2, total):
        found, exchange = run(scheme, {at: fault}, where)
        assert found.status == "converged"
        struck = step_of(at, sound.steps.iterations)
        assert found.steps.statuses[struck] == "recovered"
        assert found.steps.count("recovered") == 1
        assert found.steps.recoveries[struck] >= 1
        (number, sentence), *_ = found.steps.messages
        assert number == struck + 1
        # a NaN of the spring is refused by the mass, whose inputs must be finite
        names = {"nan": "finite", "raise": "fault of the solver", "discard": "discarded"}
        assert names[fault] in sentence
        assert fault == "nan" or f"participant {where}" in sentence
        # both are within the tolerance of each step; errors of 1e-10 add up over 12 of them
        np.testing.assert_allclose(found.x, sound.x, rtol=1e-8)
        assert exchange.time == STEPS * DT


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_faults_in_two_steps_are_both_overcome(scheme):
    sound, _ = run(scheme)
    middle = sound.evaluations // 2
    found, _ = run(scheme, {1: "discard", middle: "nan"})
    assert found.status == "converged"
    assert found.steps.count("recovered") == 2


@pytest.mark.parametrize("fault", ["nan", "raise", "discard"])
@pytest.mark.parametrize("where", ["mass", "spring"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_permanent_fault_ends_with_a_status_and_the_states_of_the_beginning_of_that_step(scheme, where, fault):
    sound, _ = run(scheme)
    first = int(sound.steps.iterations[0]) + 1
    faults = dict.fromkeys(range(first, 10 * sound.evaluations), fault)
    found, exchange = run(scheme, faults, where)
    assert found.status == "diverged"
    assert found.message.startswith("Communication step 2, to 0.1 s")
    assert found.message.endswith(".")
    assert found.steps.statuses == ["converged", "diverged"]
    assert found.time == exchange.time == DT
    after_one, one = oscillator(), SCHEMES[scheme]()
    march(after_one, one, DT, **TOLERANCES)
    for name in ("x", "v"):
        got, expected = (e.participants["mass"].get(name) for e in (exchange, after_one))
        np.testing.assert_allclose(got, expected, rtol=1e-9)  # the iteration of that step, within its tolerance


@pytest.mark.parametrize("scheme", ["relaxation", "aitken", "iqn-ils"])
def test_not_strict_goes_on_after_a_step_that_does_not_converge(scheme):
    strict, _ = run(scheme, max_iterations=1, rtol=1e-15, atol=0.0)
    assert (strict.status, len(strict.steps)) == ("max_iterations", 1)
    assert strict.time == 0.0
    loose, exchange = run(scheme, max_iterations=1, rtol=1e-15, atol=0.0, strict=False)
    assert loose.status == "max_iterations"
    assert loose.message.startswith("Communication step 1,")
    assert len(loose.steps) == STEPS
    assert exchange.time == STEPS * DT
    assert loose.steps.count("max_iterations") >= 1


def test_not_strict_ends_where_there_is_nothing_finite_to_go_on_with():
    found, _ = run("iqn-ils", {"always": "nan"}, strict=False)
    assert (found.status, len(found.steps), found.time) == ("diverged", 1, 0.0)


@pytest.mark.parametrize("scheme", ["relaxation", "aitken", "iqn-ils", "iqn-imvj"])
def test_an_implicit_scheme_refuses_a_participant_that_cannot_be_put_back_and_steps_nothing(scheme):
    exchange = oscillator()
    exchange.participants["mass"].saves_state = False
    with pytest.raises(ValueError, match=r"^participant mass cannot save .* memoryless .*\.$"):
        march(exchange, SCHEMES[scheme](), 1.0)
    assert [p.steps for p in exchange.participants.values()] == [0, 0]
    assert alive(exchange) == [0, 0]


def test_the_explicit_scheme_runs_without_states_and_a_fault_then_ends_it():
    exchange = oscillator()
    exchange.participants["mass"].saves_state = False
    assert march(exchange, None, 1.0).status == "converged"
    broken = oscillator({5: "discard"})
    broken.participants["mass"].saves_state = False
    found = march(broken, None, 1.0)
    assert (found.status, len(found.steps)) == ("diverged", 5)
    assert alive(broken) == [0, 0]


def test_a_memoryless_participant_needs_no_state():
    reference, _ = run("iqn-ils")
    exchange = oscillator()
    spring = exchange.participants["spring"]
    spring.saves_state = False
    spring.save = None  # must not be called
    exchange = Exchange(exchange.participants, exchange.connections, DT, rollback=True, memoryless=["spring"])
    found = march(exchange, IQNILS(), STEPS * DT, **TOLERANCES)
    assert np.array_equal(found.x, reference.x)


@pytest.mark.parametrize("at", [1, 2, 7, 20])
@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_an_interrupt_leaves_no_saved_state(scheme, at):
    for where in ("step", "callback"):
        exchange = oscillator()
        calls = itertools.count(1)

        def interrupt(*_, calls=calls):
            if next(calls) == at:
                raise KeyboardInterrupt

        callback = interrupt if where == "callback" else None
        if where == "step":
            mass = exchange.participants["mass"]
            advance = mass.advance
            mass.advance = lambda t, dt, advance=advance, hit=interrupt: (hit(), advance(t, dt))
        with pytest.raises(KeyboardInterrupt):
            march(exchange, SCHEMES[scheme](), 2.0, callback=callback, **TOLERANCES)
        assert alive(exchange) == [0, 0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"stop_time": 0.52}, "no whole number of steps"),
        ({"stop_time": -1.0}, "must not lie before the start"),
        ({"stop_time": np.nan}, "must not lie before the start"),
        ({"predictor": "cubic"}, "no predictor 'cubic'"),
        ({"rtol": -1.0}, "not negative"),
        ({"max_iterations": 0}, "whole number of at least 1"),
    ],
)
def test_bad_settings_are_refused_in_one_sentence_and_leave_no_saved_state(change, says):
    exchange = oscillator()
    with pytest.raises(ValueError, match=says + r".*\.$"):
        march(exchange, IQNILS(), **({"stop_time": 0.5} | change))
    assert alive(exchange) == [0, 0]


def test_an_exchange_that_goes_on_with_every_evaluation_is_refused():
    exchange = oscillator()
    exchange.rollback = False
    with pytest.raises(ValueError, match=r"rollback = True\.$"):
        march(exchange, IQNILS(), 1.0)


def test_no_step_at_all_is_converged():
    found, exchange = run("iqn-ils")
    again = march(exchange, IQNILS(), exchange.time)
    assert (again.status, len(again.steps)) == ("converged", 0)
    assert np.array_equal(again.x, found.x)


@pytest.mark.parametrize(
    ("trouble", "ends"), [(1, "torn at 100 % load"), (2, "a bug"), (3, KeyboardInterrupt)], ids=str
)
@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_an_fmu_in_trouble_ends_with_its_reason_and_no_saved_state(tmp_path, scheme, trouble, ends):
    path = tmp_path / "toy.fmu"
    path.write_bytes(archive("toy", ToyFmu(Core(), instance_name="toy"), {}))
    with FmuParticipant(path) as a, FmuParticipant(path) as b:
        links = [Connection("a", "position", "b", "load"), Connection("b", "position", "a", "load")]
        exchange = Exchange({"a": a, "b": b}, links, 0.1, rollback=True)
        assert march(exchange, SCHEMES[scheme](), 0.2).status == "converged"
        b.set("trouble", trouble)
        if isinstance(ends, str):
            result = march(exchange, SCHEMES[scheme](), 0.5)
            assert result.status == "diverged"
            assert ends in result.message
            assert result.time == 0.2
            b.set("trouble", 0)
            assert march(exchange, SCHEMES[scheme](), 0.5).status == "converged"  # it can go on from there
        else:
            with pytest.raises(ends):
                march(exchange, SCHEMES[scheme](), 0.5)
        assert not a._states
        assert not b._states
