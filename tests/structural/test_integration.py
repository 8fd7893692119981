"""Integration schemes against closed forms: orders, decay, energies, and what they do with stiff springs."""

import numpy as np
import pytest

from structural import Chains
from structural.dynamics import BDF2, GeneralisedAlpha, ImplicitEuler, Motion, integrate

from .particles import oscillation, oscillator, particles, row

SECOND = [GeneralisedAlpha(1.0), GeneralisedAlpha(0.5), GeneralisedAlpha(0.0), BDF2()]
ALL = [ImplicitEuler(), ImplicitEuler(linear=True), *SECOND]


def _position(motion, result):
    return motion.positions(result.state.q)[1, 0]


def _error(scheme, h, t=1.0, **model):
    motion, x = oscillator(**model)
    result = integrate(motion, motion.at(x), t, scheme, step=h)
    assert result.finished
    return abs(_position(motion, result) - oscillation(t, **model))


@pytest.mark.parametrize("scheme", ALL, ids=str)
def test_an_undamped_oscillator_shows_the_order_of_the_scheme(scheme):
    # w h = 0.0125 and half of it, where the next term of the error is below 2 % of the first
    coarse, fine = (_error(scheme, h) for h in (1.25e-3, 6.25e-4))
    assert abs(np.log2(coarse / fine) - scheme.order) < 0.05


@pytest.mark.parametrize("solver", ["direct", "bicgstab"])
@pytest.mark.parametrize("isotropic", [False, True])
def test_steps_as_the_thesis_makes_them_settle_at_the_same_rest(solver, isotropic):
    n = 6
    nodes = np.zeros((n, 3))
    nodes[:, 0] = np.linspace(0.0, 1.0, n)
    dead = np.tile([0.0, 0.0, -1.0], (n, 1))
    motion, x = particles(nodes, [0, n - 1], row(n, 100.0, 0.1, c=5.0), dead=dead)
    ends = [
        integrate(motion, motion.at(x), 200.0, scheme, step=0.5).state.q
        for scheme in (ImplicitEuler(), ImplicitEuler(linear=True, solver=solver, isotropic=isotropic))
    ]
    assert np.abs(ends[0] - ends[1]).max() < (1e-9 if solver == "direct" else 1e-4)  # BiCGSTAB ends at 1e-5 m/s


@pytest.mark.parametrize("c", [2.0, 20.0, 50.0], ids=["under", "critical", "over"])
@pytest.mark.parametrize("scheme", ALL, ids=str)
def test_damped_oscillators_follow_their_closed_form_with_the_order_of_the_scheme(scheme, c):
    coarse, fine = (_error(scheme, h, t=0.5, c=c) for h in (2.5e-3, 1.25e-3))
    assert abs(np.log2(coarse / fine) - scheme.order) < 0.12  # the overdamped one has 1/s terms of 48 h / 2 = 3 to 6 %
    assert fine < (5e-4 if scheme.order == 2 else 2e-2)  # (w h)^2 and w h of the amplitude, with factors around one


def test_implicit_euler_decays_as_its_estimate_says():
    # e^(-w^2 h t / 2) is the first term of an expansion in w h: at 0.01 the next is (w h)^2 / 2 of the exponent
    motion, x = oscillator()
    h, t, w = 1e-3, 2.0, 10.0
    seen = []
    integrate(motion, motion.at(x), t, ImplicitEuler(), step=h, callback=lambda s: seen.append((s.t, s.q[0], s.v[0])))
    time, q, v = np.array(seen).T
    amplitude = np.sqrt(q**2 + (v / w) ** 2)
    assert np.allclose(amplitude, np.exp(-0.5 * h * w**2 * time), rtol=0.01)


@pytest.mark.parametrize("scheme", SECOND, ids=str)
@pytest.mark.parametrize("h", [0.01, 0.1, 1.0])
def test_a_falling_particle_is_exact_for_second_order_schemes(scheme, h):
    g = np.array([0.0, 0.0, -9.81])
    motion, x = particles(
        [[0.0, 0, 0], [0.0, 0, 5.0]], [0], row(2, 1e-300, 1.0, two_way=False), dead=np.tile(g, (2, 1))
    )
    result = integrate(motion, motion.at(x), 2.0, scheme, step=h)
    assert abs(motion.positions(result.state.q)[1, 2] - (5.0 - 0.5 * 9.81 * 4.0)) < 1e-10  # rounding over 200 steps


def test_one_step_of_implicit_euler_misses_a_falling_particle_by_half_g_h_squared():
    for h in (0.1, 0.01):
        motion, x = particles([[0.0, 0, 0], [0.0, 0, 0]], [0], row(2, 1e-300, 1.0, two_way=False),
                              dead=np.tile([0.0, 0.0, -9.81], (2, 1)))  # fmt: skip
        end = integrate(motion, motion.at(x), h, ImplicitEuler(), step=h)
        assert motion.positions(end.state.q)[1, 2] == pytest.approx(-9.81 * h * h, rel=1e-12)  # exact: -g h^2 / 2


@pytest.mark.parametrize("scheme", [GeneralisedAlpha(0.5), BDF2(), ImplicitEuler()], ids=str)
def test_steps_under_error_control_meet_smaller_tolerances_with_smaller_errors(scheme):
    errors, counts = [], []
    for tolerance in (1e-4, 1e-6):
        motion, x = oscillator(c=1.0)
        result = integrate(motion, motion.at(x), 1.0, scheme, tolerance=tolerance)
        assert result.finished
        errors.append(abs(_position(motion, result) - oscillation(1.0, c=1.0)))
        counts.append(result.steps)
    assert errors[1] < 0.3 * errors[0]  # of order p: tolerances differ by 100, errors by 100^(p / (p + 1)), 10 or 21
    assert errors[1] < 100.0 * 1e-6 * counts[1]  # local errors add up, each at most the tolerance, with some phase
    assert counts[1] > 2 * counts[0]


def test_the_balance_of_energies_closes_and_a_scheme_without_damping_loses_nothing():
    motion, x = oscillator()
    lossless = integrate(motion, motion.at(x), 1.0, GeneralisedAlpha(1.0), step=0.01, energy=True).balance
    lossy = integrate(motion, motion.at(x), 1.0, ImplicitEuler(), step=0.01, energy=True).balance
    assert abs(lossless.numerical_loss) < 1e-9 * 50.0  # rounding in 100 steps, of 50 J
    assert lossy.numerical_loss == pytest.approx(50.0 - lossy.kinetic - lossy.elastic, rel=1e-9)
    assert lossy.numerical_loss > 20.0


def test_dampers_take_the_energy_that_is_missing():
    motion, x = oscillator(c=5.0)
    balance = integrate(motion, motion.at(x), 2.0, GeneralisedAlpha(1.0), step=1e-3, energy=True).balance
    assert balance.dissipated == pytest.approx(50.0 - balance.kinetic - balance.elastic, rel=1e-4)  # (w h)^2
    assert abs(balance.numerical_loss) < 1e-4 * 50.0


@pytest.mark.parametrize(
    "scheme", [ImplicitEuler(), ImplicitEuler(linear=True), GeneralisedAlpha(0.5), BDF2()], ids=str
)
def test_springs_of_1e9_newtons_per_metre_are_stable_with_steps_of_a_second(scheme):
    n = 11
    chain = row(n, 1e9, 1.0, c=1e3)
    nodes = np.zeros((n, 3))
    nodes[:, 0] = 1.001 * np.arange(n)
    dead = np.tile([0.0, 0.0, -9.81], (n, 1))
    motion, x = particles(nodes, [0, n - 1], chain, dead=dead)
    result = integrate(motion, motion.at(x), 50.0, scheme, step=1.0, energy=True)
    x = motion.positions(result.state.q)
    assert result.finished
    assert result.steps == 50
    assert np.abs(x - nodes).max() < 1e-3  # pulled by 1e6 N, it sags by 9.81 * 10 * 10 / 8 e6 m
    assert motion.kinetic_energy(result.state) < 50.0  # J of 9 kg, of 5e9 J/m^2 springs


def test_a_heavy_particle_that_jerks_a_slack_line_taut_comes_to_rest_on_it():
    line = Chains(np.array([[0, 1]]), np.array([1.0]), np.array([1e5]), np.array([False]), (), np.array([300.0]))
    dead = np.array([[0.0, 0, 0], [0.0, 0, -98.1]])
    motion, x = particles([[0.0, 0, 0], [0.0, 0, -0.2]], [0], (line,), dead=dead, mass=10.0)
    for scheme in (GeneralisedAlpha(0.5), BDF2(), ImplicitEuler()):
        result = integrate(motion, motion.at(x), 12.0, scheme, step=0.01)
        assert result.finished
        # sags by m g / k; rebounds have died by then to below a tenth of it
        assert motion.positions(result.state.q)[1, 2] == pytest.approx(-1.0 - 98.1 / 1e5, abs=1e-4)


@pytest.mark.parametrize("scheme", [GeneralisedAlpha(0.0), BDF2()], ids=str)
def test_a_pendulum_on_a_stiff_line_keeps_its_energy_and_the_period_of_the_elliptic_integral(scheme):
    from scipy.special import ellipk

    line = row(2, 1e8, 1.0, two_way=False)  # stretches by 3e-7 m at most; its own oscillation is not resolved
    dead = np.array([[0.0, 0, 0], [0.0, 0, -9.81]])
    motion, x = particles([[0.0, 0, 0], [1.0 + 1e-9, 0, 0]], [0], line, dead=dead)
    period = 4.0 * np.sqrt(1.0 / 9.81) * ellipk(np.sin(np.pi / 4) ** 2)
    result = integrate(motion, motion.at(x), period, scheme, step=period / 2000, energy=True)
    back = motion.positions(result.state.q)[1]
    # a turn is flat: a phase error e in time shows as g e^2 / 2, energy lost as height; (w h)^2 of 9.81 J is 1e-4 J
    assert np.allclose(back, [1.0, 0.0, 0.0], atol=1e-4)
    assert abs(result.balance.numerical_loss) < 1e-4


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"step": 0.0}, "time step must be a number above zero"),
        ({"step": -1.0}, "time step must be a number above zero"),
        ({"step": float("nan")}, "time step"),
        ({"step": None, "tolerance": 0.0}, "tolerance must be a number above zero"),
        ({"step": None}, "needs a time step or an error tolerance"),
        ({"stop_time": -1.0}, "must not lie before the start"),
    ],
)
def test_steps_that_cannot_be_are_refused_in_one_sentence(change, words):
    motion, x = oscillator()
    settings = {"stop_time": 1.0, "step": 0.1} | change
    with pytest.raises(ValueError, match=words):
        integrate(motion, motion.at(x), settings.pop("stop_time"), ImplicitEuler(), **settings)


def test_free_nodes_without_mass_and_negative_damping_are_refused_in_one_sentence():
    motion, x = oscillator()
    given = motion.assembly, np.array([1.0, 0.0]), motion.groups(0.0), motion.assembly
    with pytest.raises(ValueError, match="node number 1 has no mass but is free to move"):
        Motion(*given[:3], oscillator()[0]._loads(0.0)).at(x)
    with pytest.raises(ValueError, match="damping of element number 1 of Chains is -1 N s/m"):
        row(2, 1.0, 1.0, c=-1.0)
    with pytest.raises(ValueError, match="spectral radius"):
        GeneralisedAlpha(1.5)


def test_a_run_that_blows_up_ends_with_a_status_and_its_last_good_state():
    # forces that have no finite value: a load of 1e308 N grows over all bounds
    dead = np.array([[0.0, 0, 0], [1e308, 0, 0]])
    motion, x = particles([[0.0, 0, 0], [1.0, 0, 0]], [0], row(2, 1e-3, 0.0), dead=dead)
    result = integrate(motion, motion.at(x), 1e6, GeneralisedAlpha(0.5), step=1e3)
    assert result.status == "newton_failed"
    assert not result.finished
    assert np.all(np.isfinite(result.state.q))
    assert "could not be solved" in result.message
