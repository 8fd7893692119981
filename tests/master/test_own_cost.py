"""What the master itself costs: one update of the quasi-Newton scheme beside one QR decomposition of its columns."""

import time

import numpy as np
import pytest
import scipy.linalg

from master.coupling.acceleration import IQNILS

COLUMNS = 50
ATTEMPTS = 5  # a shared machine may disturb some


def seconds(work, repeats=9):
    """Median time of a call."""
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        taken.append(time.perf_counter() - begin)
    return float(np.median(taken))


def filled(n, seed=0, most=200):
    """A scheme with 50 columns of n entries in two fields, and steps of fresh data; beyond `most` the oldest go."""
    rng = np.random.default_rng(seed)
    scheme = IQNILS(max_columns=most, reuse=0)
    scheme.begin([slice(0, n // 2), slice(n // 2, n)])
    for _ in range(COLUMNS):
        scheme.step(*rng.standard_normal((2, n)))
    points = iter(rng.standard_normal((12, 2, n)))
    return scheme, lambda: scheme.step(*next(points))


@pytest.mark.parametrize("most", [200, COLUMNS], ids=["growing", "full"])
def test_an_update_costs_less_than_one_and_a_half_qr_decompositions(most):
    n = 3000
    ratios = []
    for attempt in range(ATTEMPTS):
        V = np.asfortranarray(np.random.default_rng(attempt).standard_normal((n, COLUMNS)))
        decomposition = seconds(lambda V=V: scipy.linalg.qr(V, mode="economic"))
        scheme, step = filled(n, attempt, most)
        ratios.append(seconds(step) / decomposition)
        assert COLUMNS <= scheme.columns <= min(most, COLUMNS + 15)
        if min(ratios) <= 1.5:
            return
    raise AssertionError(f"ratios {ratios}")


def test_the_cost_of_an_update_is_linear_in_the_number_of_entries():
    ratios = []
    for attempt in range(ATTEMPTS):
        small, large = (seconds(filled(n, attempt)[1]) for n in (3000, 30000))
        ratios.append(large / small)
        if min(ratios) < 20.0:  # ten times the entries, and they no longer fit into the cache
            return
    raise AssertionError(f"ratios {ratios}")
