"""Orders of the integrators on a swinging chain, against an explicit method of high order."""

import numpy as np
import pytest

from benchmarks.particle_integrators import PENDULUM, SCHEMES, orders, run


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_swinging_chain_is_found_with_the_order_of_the_scheme(scheme):
    expected = SCHEMES[scheme].order
    # waves along the springs (w = 280 rad/s) are resolved from w h = 0.7 on; two halvings from there come near the
    # order, less what the next terms leave
    fixed = [run(PENDULUM, scheme, step=h) for h in (2.5e-3, 1.25e-3, 6.25e-4)]
    assert np.all(np.isfinite([error for error, *_ in fixed]))
    assert orders(fixed)[-1] == pytest.approx(expected, abs=0.35)


@pytest.mark.parametrize("scheme", [s for s in SCHEMES if SCHEMES[s].order == 2])
def test_second_order_pays(scheme):
    # with the same step, a hundred a second, the error is at least five times less than that of implicit Euler
    assert run(PENDULUM, scheme, step=0.01)[0] < run(PENDULUM, "implicit Euler", step=0.01)[0] / 5.0


def test_the_step_linearised_once_is_as_good_as_one_solved_in_full():
    # what linearisation leaves out is of second order, the error of implicit Euler of first
    linear, full = (run(PENDULUM, s, step=2.5e-3)[0] for s in ("implicit Euler, linear", "implicit Euler"))
    assert linear == pytest.approx(full, rel=0.1)
