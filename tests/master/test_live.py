"""The plot of residuals in the terminal: decades upwards, whatever the values."""

import math

import pytest

from master.report.live import residual_plot

BULLET, DOT = "\u2022", "\u00b7"


def columns(lines):
    """Row of the mark in each column, from above, and the mark; the labels are cut off."""
    cut = [line[7:] for line in lines]
    out = []
    for column in range(max(map(len, cut))):
        marks = [
            (row, line[column]) for row, line in enumerate(cut) if column < len(line) and line[column] in BULLET + "x"
        ]
        out.append(marks[0] if marks else None)
    return out


def test_a_straight_descent_by_decades_is_a_straight_line():
    lines = residual_plot([10.0**-k for k in range(12)], 1e-11, width=20, rows=12)
    assert [mark for mark in columns(lines) if mark] == [(k, BULLET) for k in range(12)]
    assert (lines[0][:6].strip(), lines[-1][:6].strip()) == ("1e+00", "1e-11")
    assert DOT in lines[-1]


@pytest.mark.parametrize(
    ("history", "row", "mark"),
    [
        ([0.0], -1, BULLET),
        ([math.nan], 0, "x"),
        ([math.inf], 0, "x"),
        ([1e-4], None, BULLET),
        ([5e-324], -1, BULLET),
        ([1.7e308], 0, BULLET),
    ],
)
def test_a_single_value_has_its_place(history, row, mark):
    lines = residual_plot(history, 1e-5, width=10, rows=8)
    assert len(lines) == 8
    ((at, seen),) = [m for m in columns(lines) if m]
    assert seen == mark
    if row is not None:
        assert at == range(8)[row]


def test_mixed_values_keep_their_columns():
    lines = residual_plot([1.0, math.nan, 1e-3, 0.0, math.inf, 1e-6], 1e-5, width=9, rows=7)
    assert columns(lines)[:6] == [(0, BULLET), (0, "x"), (3, BULLET), (6, BULLET), (0, "x"), (6, BULLET)]


def test_of_many_values_the_last_are_shown():
    history = [1.0] * 500 + [1e-6] * 30
    lines = residual_plot(history, 1e-6, width=30, rows=10)
    assert {len(line) for line in lines} == {37}
    assert all(mark == (9, BULLET) or mark == (columns(lines)[0][0], BULLET) for mark in columns(lines))
    assert len([m for m in columns(lines) if m]) == 30


@pytest.mark.parametrize("history", [[], [0.0], [math.nan], [0.0, math.nan, math.inf]])
@pytest.mark.parametrize("tolerance", [0.0, 1e-5, math.inf])
def test_nothing_that_has_a_logarithm_is_no_obstacle(history, tolerance):
    lines = residual_plot(history, tolerance, width=10, rows=6)
    assert len(lines) == 6
    assert len([m for m in columns(lines) if m]) == len(history)


@pytest.mark.parametrize("width", [1, 0, -8])
def test_a_narrow_terminal_shows_at_least_the_last_value(width):
    lines = residual_plot([1.0, 1e-3, 1e-6], 1e-5, width=width, rows=4)
    assert [m for m in columns(lines) if m] == [(3, BULLET)]


def test_values_that_are_all_alike_stay_inside():
    lines = residual_plot([1e-5] * 7, 1e-5, width=10, rows=5)
    assert len([m for m in columns(lines) if m]) == 7
