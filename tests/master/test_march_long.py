"""Transient runs against closed forms and monolithic solves: added mass, predictors, and what long runs leave."""

import numpy as np
import pytest

from fmus.builder import archive
from master.coupling import Connection, Exchange, FmuParticipant
from master.coupling.acceleration import IQNILS, Aitken, ConstantRelaxation
from master.coupling.march import Predictor, march
from tests.fmus.toy_fmu import Toy as Core
from tests.fmus.toy_fmu import ToyFmu
from tests.master.toys import Mass, Spring, Toy

DT = 1e-4


class Wall(Toy):
    """Modes of a light wall, (rho h (x - 2 x1 + x2) / dt^2 + a x = p), pressure in, displacement out."""

    def __init__(self, h, modes):
        zero = np.zeros(modes)
        super().__init__(
            "wall",
            {"p": ("input", zero), "x": ("output", zero), "x1": ("local", zero), "x2": ("local", zero)},
        )
        self.inertia, self.a = 1.1 * h / DT**2, 4e5

    def advance(self, t, dt):
        v = self.values
        v["x2"], v["x1"] = v["x1"], v["x"]
        v["x"] = (v["p"] + self.inertia * (2.0 * v["x1"] - v["x2"])) / (self.inertia + self.a)


class Channel(Toy):
    """Modes of inviscid flow beside it, p = p_ext - mu (x - 2 x1 + x2) / dt^2, displacement in, pressure out.

    The flow remembers the displacements of the last two steps itself.
    """

    def __init__(self, modes):
        i = np.arange(1, modes + 1)
        zero = np.zeros(modes)
        super().__init__(
            "channel", {"x": ("input", zero), "p": ("output", zero), "x1": ("local", zero), "x2": ("local", zero)}
        )
        self.mu = 6.0 / (i * np.pi * np.tanh(i * np.pi * 0.5 / 6.0))
        self.p_ext = 2e4 / i

    def advance(self, t, dt):
        v = self.values
        v["p"] = self.p_ext - self.mu * (v["x"] - 2.0 * v["x1"] + v["x2"]) / DT**2
        v["x2"], v["x1"] = v["x1"], v["x"].copy()


def added_mass(h, modes=10):
    participants = {"channel": Channel(modes), "wall": Wall(h, modes)}
    connections = [Connection("channel", "p", "wall", "p"), Connection("wall", "x", "channel", "x")]
    return Exchange(participants, connections, DT, rollback=True)


def monolithic(h, steps, modes=10):
    """Displacement of the wall with the mass of the flow added to its own."""
    mu, p = Channel(modes).mu, Channel(modes).p_ext
    inertia = (1.1 * h + mu) / DT**2
    x = np.zeros((3, modes))
    for _ in range(steps):
        x = np.roll(x, 1, axis=0)
        x[0] = (p + inertia * (2.0 * x[1] - x[2])) / (inertia + 4e5)
    return x[0]


@pytest.mark.parametrize("make", [IQNILS, lambda: IQNILS(reuse=0), lambda: Aitken(omega=0.05)])
@pytest.mark.parametrize("h", [0.1, 1.0, 20.0])
def test_implicit_coupling_of_a_light_wall_is_the_monolithic_solution(h, make):
    exchange = added_mass(h, modes=3)
    result = march(exchange, make(), 20 * DT, rtol=1e-11, max_iterations=300)
    assert result.status == "converged", result.message
    # the tolerance of a step, which 20 steps of a second difference amplify by 20^2
    np.testing.assert_allclose(result.x, monolithic(h, 20, modes=3), rtol=1e-8)


def test_explicit_coupling_is_unstable_if_and_only_if_the_wall_is_lighter_than_the_added_mass():
    mu = Channel(10).mu.max()
    for ratio in (0.9, 1.1):  # rho_s h / mu_max on both sides of the bound
        h = ratio * mu / 1.1
        exchange = added_mass(h)
        result = march(exchange, None, 300 * DT)
        assert result.status == "converged"  # it is not iterated, so nothing judges it
        growth = np.abs(result.x).max() / np.abs(monolithic(h, 300)).max()
        assert (growth > 1e6) == (ratio < 1.0)


@pytest.mark.parametrize(("kind", "degree"), [("constant", 0), ("linear", 1), ("quadratic", 2)])
def test_a_predictor_is_exact_for_polynomials_of_its_degree_in_uneven_times(kind, degree):
    coefficients = np.random.default_rng(0).standard_normal((degree + 1, 5))
    predictor = Predictor(kind)
    for k, t in enumerate((0.0, 0.7, 1.0, 2.5)):
        value = sum(c * t**p for p, c in enumerate(coefficients))
        if k > degree:
            assert predictor.at(t) == pytest.approx(value, abs=1e-12)  # rounding
        predictor.add(t, value)


def test_a_predictor_begins_with_what_there_is_and_forgets_all_but_the_last():
    predictor = Predictor("quadratic")
    predictor.add(0.0, np.array([1.0]))
    assert predictor.at(9.0) == 1.0
    predictor.add(1.0, np.array([3.0]))
    assert predictor.at(2.0) == 5.0
    predictor.forget()
    assert predictor.at(7.0) == 3.0


def oscillator(dt=0.02):
    connections = [Connection("spring", "f", "mass", "f"), Connection("mass", "x", "spring", "x")]
    return Exchange({"spring": Spring(4.0, 1.0), "mass": Mass(1.0, forces=-5.0)}, connections, dt, rollback=True)


def test_extrapolation_saves_evaluations_on_a_smooth_motion():
    counts, ends = {}, {}
    for kind in ("constant", "linear", "quadratic"):
        result = march(oscillator(), ConstantRelaxation(1.0), 2.0, predictor=kind, rtol=1e-9)
        counts[kind], ends[kind] = result.evaluations, result.x
    assert counts["quadratic"] <= counts["linear"] < counts["constant"]
    np.testing.assert_allclose(ends["linear"], ends["constant"], rtol=1e-6)  # 1e-9 in each of 100 steps


class Echo(Toy):
    """Answers with part of what it was given and a wave."""

    def __init__(self):
        super().__init__("echo", {"in": ("input", [0.0]), "out": ("output", [0.0])})

    def advance(self, t, dt):
        self.values["out"] = 0.1 * self.values["in"] + np.sin(t)


def echo(dt):
    participants = {"a": Echo(), "b": Echo()}
    return Exchange(
        participants, [Connection("a", "out", "b", "in"), Connection("b", "out", "a", "in")], dt, rollback=True
    )  # fmt: skip


class Growth:
    """Callback that notes the resident memory, pages, after the first hundred steps and at the last call."""

    def __init__(self):
        self.calls, self.first, self.last = 0, 0, 0

    def __call__(self, *_):
        self.calls += 1
        if self.calls == 100:
            self.first = resident()
        elif self.calls % 100 == 0:
            self.last = resident()


def resident():
    """Resident memory of this process, pages."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1])


@pytest.mark.parametrize(("make", "steps"), [(lambda: None, 10_000), (IQNILS, 1000)], ids=["explicit", "iqn-ils"])
def test_thousands_of_steps_of_a_tenth_of_a_second_do_not_drift_and_leave_nothing_behind(make, steps):
    exchange = echo(0.1)
    growth = Growth()
    result = march(exchange, make(), round(0.1 * steps), callback=growth, rtol=1e-8)
    assert result.status == "converged", result.message
    assert (exchange.time, result.time, result.steps.times[-1]) == (0.1 * steps,) * 3
    # multiples of a tenth as double precision has them; a running sum is off by 1e-10 here
    assert np.array_equal(result.steps.times, 0.1 * np.arange(1, steps + 1))
    assert [p.alive for p in exchange.participants.values()] == [0, 0]
    assert max(p.most_alive for p in exchange.participants.values()) == 1
    assert growth.last < 1.01 * growth.first  # 27 bytes a step are kept


def test_thousands_of_steps_of_two_fmus_free_every_state(tmp_path, monkeypatch):
    path = tmp_path / "toy.fmu"
    path.write_bytes(archive("toy", ToyFmu(Core(), instance_name="toy"), {}))
    alive = {"now": 0, "most": 0, "saved": 0}
    save, free = FmuParticipant.save, FmuParticipant.free

    def counted_save(self):
        alive["now"] += 1
        alive["saved"] += 1
        alive["most"] = max(alive["most"], alive["now"])
        return save(self)

    def counted_free(self, state):
        alive["now"] -= 1
        free(self, state)

    monkeypatch.setattr(FmuParticipant, "save", counted_save)
    monkeypatch.setattr(FmuParticipant, "free", counted_free)
    steps, growth = 2000, Growth()
    with FmuParticipant(path, {"gain": 0.1}) as a, FmuParticipant(path, {"gain": 0.2}) as b:
        connections = [Connection("a", "position", "b", "load"), Connection("b", "position", "a", "load")]
        exchange = Exchange({"a": a, "b": b}, connections, 0.1, rollback=True)
        a.set("load", np.full((2, 3), 0.5))
        result = march(exchange, None, 0.1 * steps, callback=growth)
        assert result.status == "converged"
        assert (alive["now"], alive["saved"], alive["most"]) == (0, 2 * steps, 2)
        assert not a._states
        assert not b._states
    assert growth.last < 1.01 * growth.first  # states of both would be 2 kB a step
