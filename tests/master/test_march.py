"""The time loop: orders of convergence, added mass, recoveries, and what it leaves behind."""

import numpy as np
import pytest

from master.coupling import Connection, Exchange
from master.coupling.acceleration import IQNILS
from master.coupling.march import march
from tests.master.toys import Mass, Spring

K, M = 4.0, 1.0  # 2 rad/s


def oscillator(dt, mass=None, spring=None, **options):
    """A mass on a spring, in two participants."""
    participants = {"spring": spring or Spring(K), "mass": mass or Mass(M, forces=-K)}
    connections = [Connection("spring", "f", "mass", "f"), Connection("mass", "x", "spring", "x")]
    return Exchange(participants, connections, dt=dt, rollback=True, **options)


def end_error(dt, scheme, **options):
    """|x - cos 2t| at 1 s."""
    exchange = oscillator(dt, **options.pop("exchange", {}))
    result = march(exchange, scheme, 1.0, rtol=1e-12, atol=1e-14, **options)
    assert result.status == "converged", result.message
    return abs(float(exchange.participants["mass"].get("x")[0]) - np.cos(2.0))


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_the_coupled_oscillator_converges_with_order_two_implicit(order):
    errors = [end_error(dt, IQNILS(), order=order) for dt in (0.1, 0.05, 0.025)]
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    assert observed == pytest.approx(2.0, abs=0.05)  # the next term of the error expansion


def test_the_explicit_scheme_is_of_first_order_in_time_parallel_and_second_where_the_force_is_new():
    # serial: the spring answers the position at the beginning of the step, so the force lags by one step
    for order in ("serial", "parallel"):
        errors = [end_error(dt, None, order=order) for dt in (0.02, 0.01, 0.005)]
        observed = np.log2(np.array(errors[:-1]) / errors[1:])
        assert observed == pytest.approx(1.0, abs=0.15)
