"""A scheme that makes energy by itself ends with a status that says so; one that only errs or damps does not."""

import numpy as np
import pytest

from structural import Chains
from structural.dynamics import BDF2, GeneralisedAlpha, integrate

from .particles import particles, row


def _rattling(lines=6):
    """A row of particles between stiff lines that are slack at first, which rebound and go slack again."""
    nodes = np.column_stack([np.linspace(0.0, 1.0, lines + 1), np.zeros(lines + 1), np.zeros(lines + 1)])
    ends = np.stack([np.arange(lines), np.arange(1, lines + 1)], axis=1)
    line = Chains(ends, np.full(lines, 1.02 / lines), np.full(lines, 1e7), np.zeros(lines, bool))
    motion, x = particles(nodes, [0, lines], (line,))
    v = np.random.default_rng(1).normal(size=x.shape)
    v[[0, -1]] = 0.0
    return motion, motion.at(x, v)


@pytest.mark.parametrize("radius", [0.9, 0.6])
def test_rebounds_that_return_more_energy_than_they_got_end_the_run(radius):
    motion, begin = _rattling()
    result = integrate(motion, begin, 20.0, GeneralisedAlpha(radius), step=0.01, energy=True)
    assert result.status == "energy_made"
    assert not result.finished
    assert "made" in result.message
    balance = result.balance
    assert -balance.numerical_loss > balance.begun_with + balance.exchanged
    assert balance.begun_with == pytest.approx(
        motion.kinetic_energy(begin), rel=1e-6
    )  # cancellation of ten times as much
    unwatched = integrate(motion, begin, 20.0, GeneralisedAlpha(radius), step=0.01)
    assert motion.kinetic_energy(unwatched.state) > 10.0 * motion.kinetic_energy(begin)  # what would have been told


@pytest.mark.parametrize("scheme", [GeneralisedAlpha(0.0), BDF2()], ids=str)
def test_schemes_that_leave_nothing_of_what_they_do_not_resolve_make_none(scheme):
    motion, begin = _rattling()
    result = integrate(motion, begin, 20.0, scheme, step=0.01, energy=True)
    assert result.finished
    assert result.balance.kinetic < motion.kinetic_energy(begin)


@pytest.mark.parametrize("x", [1.0, 1.3])
def test_errors_of_coarse_steps_are_no_energy_that_is_made(x):
    """A spring at rest or swinging, eight steps a period: the balance errs by its order, and by rounding at rest."""
    motion, nodes = particles([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0], row(2, 100.0, 1.0))
    nodes[1, 0] = x
    assert integrate(motion, motion.at(nodes), 10.0, GeneralisedAlpha(1.0), step=0.08, energy=True).finished
