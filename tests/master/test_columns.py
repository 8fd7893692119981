"""The growing QR decomposition: it is one, whatever comes and goes."""

import pickle
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from master.coupling.acceleration.columns import Columns

# Gram-Schmidt twice leaves a few rounding errors in each column and a dependent one loses its last 1e-14 part.
ROUNDING = 1e-13


def error(columns, kept):
    """Largest error of a column of Q R, relative to the column."""
    sizes = np.array([np.abs(v).max() or 1.0 for v in kept])
    return np.abs((columns.matrix() - np.array(kept)) / sizes[:, None]).max(initial=0.0)


def skew(columns):
    """Largest entry of Q^T Q - I."""
    return np.abs(columns.basis @ columns.basis.T - np.eye(columns.rank)).max(initial=0.0)


@st.composite
def histories(draw):
    """A size n, and what comes and goes: a column with its scale, a copy, a sum, a zero, or a number to drop."""
    n = draw(st.integers(1, 12))
    event = st.one_of(
        st.tuples(st.just("new"), st.integers(-300, 300), st.integers(0, 2**31)),
        st.tuples(st.sampled_from(["again", "sum", "zero"]), st.just(0), st.just(0)),
        st.tuples(st.just("drop"), st.integers(0, 6), st.just(0)),
    )
    return n, draw(st.lists(event, max_size=40))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(histories())
def test_the_columns_are_q_times_r_after_any_history(history):
    n, events = history
    columns, kept = Columns(), []
    for kind, number, seed in events:
        if kind == "drop":
            columns.drop(number)
            kept = kept[number:]
        else:
            v = np.zeros(n)
            if kind == "new":
                v = 10.0**number * np.random.default_rng(seed).uniform(-1.0, 1.0, n)
            elif kind == "again" and kept:
                v = kept[-1].copy()
            elif kind == "sum" and len(kept) > 1:
                v = 0.5 * kept[-1] + 0.5 * kept[-2]
            columns.append(v)
            kept.append(v)
        assert columns.count == len(kept)
        assert columns.rank <= min(n, columns.count)
        if kept:
            assert error(columns, kept) < ROUNDING
            assert skew(columns) < ROUNDING


def test_a_thousand_cycles_leave_the_basis_orthonormal_and_the_columns_true():
    rng = np.random.default_rng(0)
    columns, kept = Columns(), []
    for k in range(1000):
        kept.append(rng.standard_normal(60) * 10.0 ** rng.uniform(-8, 8))
        columns.append(kept[-1])
        if k >= 20:
            columns.drop(1)
            del kept[0]
    # each product with a small orthogonal matrix adds rounding, which does not grow but adds up: 1000 of 2e-16
    assert skew(columns) < 1e-12
    assert error(columns, kept) < 1e-12


def test_dropping_in_portions_is_dropping_at_once():
    vectors = np.random.default_rng(1).standard_normal((12, 30))
    one, two = Columns(), Columns()
    for v in vectors:
        one.append(v)
        two.append(v)
    one.drop(7)
    for k in (3, 0, 4):
        two.drop(k)
    assert np.abs(one.matrix() - two.matrix()).max() < ROUNDING
    assert (one.rank, one.count) == (two.rank, two.count) == (5, 5)


def test_dependent_and_zero_columns_add_no_direction():
    a, b = np.random.default_rng(2).standard_normal((2, 40))
    columns = Columns()
    for v in (a, 2.0 * a, np.zeros(40), b, a - 3.0 * b, 1e-200 * b):
        columns.append(v)
    assert (columns.count, columns.rank) == (6, 2)
    assert error(columns, [a, 2.0 * a, np.zeros(40), b, a - 3.0 * b, 1e-200 * b]) < ROUNDING


def test_columns_that_are_all_zero_come_and_go():
    columns = Columns()
    for _ in range(20):
        columns.append(np.zeros(5))
    columns.drop(7)
    assert (columns.count, columns.rank) == (13, 0)
    columns.append(np.arange(5.0))
    assert error(columns, [np.zeros(5)] * 13 + [np.arange(5.0)]) < ROUNDING


def test_more_columns_than_entries_keep_the_rank_at_n():
    vectors = np.random.default_rng(3).standard_normal((50, 3))
    columns = Columns()
    for v in vectors:
        columns.append(v)
    assert columns.rank == 3
    assert error(columns, list(vectors)) < ROUNDING
    columns.drop(49)
    assert columns.rank == 1
    assert error(columns, [vectors[-1]]) < ROUNDING


@pytest.mark.parametrize("scale", [5e-324, 1e-310, 1e-300, 1e-160, 1e160, 1e300])
def test_scales_at_the_ends_of_double_precision_lose_nothing(scale):
    vectors = scale * np.round(np.random.default_rng(4).uniform(-9.0, 9.0, (6, 10)))  # whole multiples
    columns = Columns()
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        for v in vectors:
            columns.append(v)
        columns.drop(2)
    # R is rounded to the smallest number there is, too
    assert np.abs(columns.matrix() - vectors[2:]).max() <= ROUNDING * 10.0 * scale + 20.0 * 5e-324
    assert skew(columns) < ROUNDING


def test_a_column_is_not_changed_by_being_added():
    v = np.arange(4.0)
    columns = Columns()
    columns.append(v)
    columns.append(v)
    assert np.array_equal(v, np.arange(4.0))


@pytest.mark.parametrize("copy", [deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
def test_a_stored_decomposition_goes_on_bitwise(copy):
    rng = np.random.default_rng(5)
    columns = Columns()
    for _ in range(13):
        columns.append(rng.standard_normal(25))
    columns.append(np.zeros(25))
    columns.drop(3)
    twin = copy(columns)
    for _ in range(9):
        v = rng.standard_normal(25)
        for c in (columns, twin):
            c.append(v)
            c.drop(1)
    assert np.array_equal(columns.basis, twin.basis)
    assert np.array_equal(columns.factors, twin.factors)
    assert columns.count == twin.count


def test_an_empty_decomposition_can_be_stored():
    twin = pickle.loads(pickle.dumps(Columns()))
    twin.append(np.ones(4))
    assert (twin.count, twin.rank) == (1, 1)
    assert Columns().matrix().size == 0
