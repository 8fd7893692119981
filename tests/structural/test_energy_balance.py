"""The balance of energies of moving particles, term by term against closed forms: reeling, line with mass, dampers."""

from dataclasses import replace

import numpy as np
import pytest

from structural import Chains, Loads
from structural.dynamics import BDF2, Balance, GeneralisedAlpha, ImplicitEuler, Motion, integrate
from structural.elements import Configuration

from .particles import particles, row
from .test_own_elements import Cubic

ENDS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]


def _reeled(chains, rate, mass=1.0, dead=None, nodes=ENDS, k=None):
    """A particle on an element whose rest length grows by `rate` m/s; its stiffness is `k(l0)` N/m, or stays."""
    start, x = particles(nodes, [0], chains, dead=dead, mass=mass)

    def at(t):
        l0 = chains[0].l0 + rate * t
        speed = np.full(1, rate)
        return (replace(chains[0], l0=l0, k=chains[0].k if k is None else k(l0), l0_rate=speed),)

    loads = Loads(np.zeros((2, 3)) if dead is None else dead)
    return Motion(start.assembly, np.full(2, mass), loads, at), x


def _closes(balance, stored):
    sums = balance.work + balance.reeled - balance.dissipated - balance.numerical_loss
    scale = max(abs(v) for v in vars(balance).values())
    return balance.kinetic + balance.elastic - stored == pytest.approx(sums, abs=1e-12 * scale)  # rounding of the sums


@pytest.mark.parametrize("scheme", [GeneralisedAlpha(1.0), GeneralisedAlpha(0.0), BDF2()], ids=str)
def test_a_spring_whose_rest_length_is_ramped_takes_the_work_of_its_closed_form(scheme):
    """x'' = -w^2 (x - l0), l0 = 1 + r t from rest: s = -(r / w) sin(w t), and the work is m r^2 (1 - cos(w t))."""
    w, r, end = 10.0, 0.3, 0.2
    exact, errors = r * r * (1.0 - np.cos(w * end)), []
    for h in (2e-3, 1e-3):
        motion, x = _reeled(row(2, w * w, 1.0), r)
        balance = integrate(motion, motion.at(x), end, scheme, step=h, energy=True).balance
        assert _closes(balance, 0.0)
        errors.append(abs(balance.reeled - exact))
    assert errors[1] < 1e-3 * exact  # (w h)^2 with a factor of some
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)  # of second order


@pytest.mark.parametrize("h", [0.5, 0.05, 0.005])
def test_a_weight_that_is_let_down_faster_than_its_line_stretches_does_its_weight_times_the_way(h):
    """2 m/s let down a weight of 20 N at constant speed: the tension is the weight, whatever the step. The line is
    stretched by 2 mm, a fiftieth of what a step of 0.05 s pays out."""
    line = Chains(np.array([[0, 1]]), np.array([1.0]), np.array([1e4]), np.array([False]))
    below = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.002]]
    motion, x = _reeled((line,), 2.0, 2.0, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -20.0]]), below)
    begin = motion.at(x, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -2.0]]))
    balance = integrate(motion, begin, 1.0, GeneralisedAlpha(), step=h, energy=True).balance
    assert balance.reeled == pytest.approx(-40.0, rel=1e-6)  # rounding of coordinates of 3 m beside 2 mm
    assert balance.work == pytest.approx(40.0, rel=1e-6)
    assert abs(balance.numerical_loss) < 1e-4


@pytest.mark.parametrize("lengths", [(1.3, 0.9), (0.9, 1.3), (0.9, 0.95), (1.3, 1.2), (1.0, 0.8)])
def test_a_line_that_is_slack_part_of_the_step_is_worked_on_by_what_its_energy_grows(lengths):
    """Both ends stand still, so all that reeling puts in is stored; the stiffness goes with the length, EA / l0."""
    before, after = (Chains(np.array([[0, 1]]), np.array([l]), np.array([1e4 / l]), np.array([False])) for l in lengths)
    at = Configuration(np.array(ENDS))
    stored = after.energy(at) - before.energy(at)
    assert before.changing_work(after, at, at) == pytest.approx(stored, rel=1e-12, abs=1e-12)


def test_two_way_springs_are_worked_on_through_their_rest_length():
    before, after = (Chains(np.array([[0, 1]]), np.array([l]), np.array([1e4]), np.array([True])) for l in (1.3, 0.9))
    at = Configuration(np.array(ENDS))
    assert before.changing_work(after, at, at) == pytest.approx(after.energy(at) - before.energy(at), rel=1e-12)


def test_mass_that_comes_in_brings_the_kinetic_energy_of_its_node():
    """A particle without force keeps its speed; as its mass grows by 2 kg at 3 m/s, 9 J come in."""
    motion, x = particles(ENDS, [0], row(2, 1e-300, 1.0))
    growing = Motion(motion.assembly, lambda t: np.full(2, 1.0 + t), Loads(np.zeros((2, 3))), motion.groups(0.0))
    begin = growing.at(x, np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 0.0]]))
    balance = integrate(growing, begin, 2.0, GeneralisedAlpha(), step=0.1, energy=True).balance
    assert balance.reeled == pytest.approx(9.0, rel=1e-12)
    assert abs(balance.numerical_loss) < 1e-11


@pytest.mark.parametrize("taut", [1.0, 0.5, 0.01])
def test_a_damper_takes_heat_while_its_line_is_taut_only(taut):
    """At 2 m/s over 0.1 m, the last part of them taut: c v s with c = 1 N s/m."""
    line = Chains(np.array([[0, 1]]), np.array([1.1 - 0.1 * taut]), np.array([1e3]), np.array([False]), (), np.ones(1))
    v = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    near, far = (Configuration(np.array([[0.0, 0.0, 0.0], [l, 0.0, 0.0]]), None, v) for l in (1.0, 1.1))
    heat, reeled = line.damper_work(line, near, far)
    assert heat == pytest.approx(2.0 * 0.1 * taut, rel=1e-9)  # rounding of a stretch of 1 mm
    assert reeled == 0.0


@pytest.mark.parametrize("scheme", [GeneralisedAlpha(0.0), ImplicitEuler()], ids=str)
def test_dampers_that_are_reeled_take_all_that_reeling_puts_into_them(scheme):
    """Both ends are held: c r^2 t goes through the damper as heat, beside what the spring stores."""
    k, c, r = 100.0, 5.0, -0.2
    chain = row(2, k, 1.0, c)
    motion, x = particles(ENDS, [0, 1], chain)
    moving = Motion(
        motion.assembly,
        np.ones(2),
        Loads(np.zeros((2, 3))),
        lambda t: (replace(chain[0], l0=chain[0].l0 + r * t, l0_rate=np.full(1, r)),),
    )
    balance = integrate(moving, moving.at(x), 1.0, scheme, step=0.1, energy=True).balance
    assert balance.dissipated == pytest.approx(c * r * r, rel=1e-12)
    assert balance.reeled == pytest.approx(c * r * r + 0.5 * k * r * r, rel=1e-12)
    assert abs(balance.numerical_loss) < 1e-14


class StoredCubic(Cubic):
    """Springs of the tension k s^3 that know their energy and say nothing of reeling."""

    def energy(self, at):
        length = np.linalg.norm(at.x[self.nodes[:, 1]] - at.x[self.nodes[:, 0]], axis=1)
        return float(np.sum(0.25 * self.k * (length - self.l0) ** 4))


def test_families_of_elements_that_say_nothing_of_reeling_are_worked_on_by_their_tension():
    """Both its ends go with the rest length: -T dl0 for 0.5 m at a stretch of 0.01 m, a fiftieth of it."""
    before = StoredCubic(np.array([[0, 1]]), np.array([1.0]), np.array([1e6]))
    after = replace(before, l0=np.array([1.5]))
    begin, end = (Configuration(np.array([[0.0, 0.0, 0.0], [l, 0.0, 0.0]])) for l in (1.01, 1.51))
    # T = 1 N; the difference over a ten thousandth of 0.5 m, 0.5 % of the stretch, is good to its square
    assert before.changing_work(after, begin, end) == pytest.approx(-0.5, rel=1e-4)
    assert before.changing_work(before, begin, end) == 0.0


def test_a_balance_goes_on_where_an_earlier_one_ended():
    motion, x = _reeled(row(2, 100.0, 1.0), 0.3)
    whole = integrate(motion, motion.at(x), 0.2, GeneralisedAlpha(), step=0.01, energy=True).balance
    half = integrate(motion, motion.at(x), 0.1, GeneralisedAlpha(), step=0.01, energy=True)
    rest = integrate(motion, half.state, 0.2, GeneralisedAlpha(), step=0.01, energy=half.balance).balance
    assert isinstance(rest, Balance)
    for name, value in vars(whole).items():
        assert getattr(rest, name) == pytest.approx(value, rel=1e-12, abs=1e-15)
