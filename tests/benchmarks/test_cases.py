"""Every registered case says what it measures, and a slice of it behaves as it says; the harness judges and goes on."""

import contextlib
import csv
import itertools
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.harness import COLUMNS, ROOT, exponents, measured, write_csv, wrong
from benchmarks.plots import Branches, draw
from benchmarks.registry import Case, Curve, Fit, Multiples, Outcome, Table, registered
from benchmarks.run import run

CASES = [entry for entry in registered().values() if isinstance(entry, Case)]


@contextlib.contextmanager
def power_law(series, value):
    """A problem whose error is value^-2."""
    yield lambda: Outcome(value**-2.0, {"count": int(value)})


SAMPLE = Case(
    name="sample.power", title="Sample", knob="n", values=(1.0, 2.0, 4.0), quick=(2.0, 4.0), error="error", unit="m",
    reference="exact", prepare=power_law, truth=lambda series, value: 0.0, bound=0.1, finer="larger", repeats=2,
    fit=Fit("value", "error", "error ~ n"), labels={"count": "count"},
)  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_case_names_its_knob_its_error_with_unit_its_reference_and_its_bound(case):
    assert all(text.strip() for text in (case.title, case.knob, case.error, case.unit, case.reference))
    assert case.bound > 0.0
    assert case.repeats >= 1
    assert case.loops >= 1
    assert set(case.quick) <= set(case.values)
    assert set(case.quick_series or ()) <= set(case.series)
    assert case.ratio_to is None or case.ratio_to in case.series
    assert len(set(case.points())) == len(case.points())


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_slice_of_a_case_is_solved_and_its_error_falls_with_the_knob(case, tmp_path):
    rows = measured(case, quick=True, memory=False)
    assert not wrong(case, rows)
    for series in {row["series"] for row in rows} if case.finer else ():
        own = sorted((row["value"], row["error"]) for row in rows if row["series"] == series)
        errors = [error for _, error in (own if case.finer == "larger" else own[::-1])]
        # each step of a slice changes the knob by 2 or more (tolerances by 100), the orders seen are about one
        assert all(b < a for a, b in itertools.pairwise(errors)), (series, own)
    write_csv(tmp_path / "rows.csv", rows)
    with (tmp_path / "rows.csv").open(newline="") as file:
        header = next(csv.reader(file))
    assert tuple(header[: len(COLUMNS)]) == COLUMNS
    assert set(header[len(COLUMNS) :]) == set(case.labels), "every further column has a label, and only they"
    plot = case.plot
    axes = (plot.x, plot.y) if isinstance(plot, Curve) else (plot.x, *plot.ys, plot.across, plot.lines)
    assert set(axes) <= set(header)


def test_every_table_gives_rows_under_a_head(monkeypatch):
    tables = [entry for entry in registered().values() if isinstance(entry, Table)]
    assert tables
    for entry in tables:
        if entry.name in ("v3_aero.coefficients", "v3_aero.errors", "v3_aero.direction"):  # the others take seconds
            text = entry.build(True).splitlines()
            assert text[0].startswith("| ")
            assert set(text[1]) <= set("|-")
            assert text[2].count("|") == text[0].count("|")


def test_the_exponent_of_a_power_law_is_its_exponent():
    rows = measured(SAMPLE, memory=False)
    assert exponents(SAMPLE, rows)[""] == pytest.approx(-2.0, abs=1e-12)  # rounding of logarithms


def test_ratios_divide_the_times_of_one_round():
    @contextlib.contextmanager
    def waiting(series, value):
        yield lambda: Outcome(0.0, {"sum": sum(range(200_000 if series == "slow" else 20_000))})

    case = replace(SAMPLE, prepare=waiting, series=("fast", "slow"), ratio_to="fast", repeats=9, fit=None)
    ratios = {row["series"]: row["time_ratio"] for row in measured(case, memory=False)}
    assert ratios["fast"] == 1.0
    assert 2.0 < ratios["slow"] < 50.0  # ten times the additions; medians, so that a pause of the machine is left out


ARRAYS = """
import contextlib
from types import SimpleNamespace
import numpy as np
from benchmarks.memory import growth

@contextlib.contextmanager
def array(series, megabytes):
    yield lambda: float(np.ones(int(megabytes * 2**17)).sum())

case = SimpleNamespace(name="sample.arrays", prepare=array)
print(growth(case, ("", 80.0)), growth(case, ("", 1.0)))
"""


def test_memory_is_that_of_the_solve_in_its_own_process():
    """From a fresh process, as benchmarks are measured: one that has freed much fills what is left of that first."""
    done = subprocess.run([sys.executable, "-c", ARRAYS], capture_output=True, text=True, check=True, cwd=ROOT)
    large, small = map(float, done.stdout.split())
    assert large == pytest.approx(80.0, rel=0.1)  # pages and what the interpreter itself takes
    assert small < 10.0  # nothing is left of the 80


def test_what_is_wrong_is_said_of_the_finest_value_or_of_all():
    rows = measured(SAMPLE, memory=False)
    assert not wrong(SAMPLE, rows)  # 1 and 1/4 exceed the bound of 0.1, 1/16 at the finest value does not
    assert len(wrong(replace(SAMPLE, finer=None), rows)) == 2
    rows[0]["status"] = "stalled"
    assert wrong(SAMPLE, rows) == ["sample.power at n 1.0 ended as stalled."]
    rows[-1]["error"] = math.nan
    assert "error of nan" in wrong(SAMPLE, rows)[1]


def test_a_failing_case_leaves_nothing_behind_and_does_not_keep_the_others_from_running(tmp_path, monkeypatch, capsys):
    def broken(quick):
        raise ZeroDivisionError("no such table")

    for suffix in (".csv", ".md", ".svg"):
        (tmp_path / f"sample.bad{suffix}").write_text("old")
    entries = [replace(SAMPLE, name="sample.bad", bound=1e-9), Table("sample.broken", "Broken", broken), SAMPLE]
    failed = run(entries, tmp_path, memory=False)
    assert len(failed) == 2
    assert "more than 1e-09" in failed[0]
    assert "sample.broken raised ZeroDivisionError: no such table" in failed[1]
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"machine.json", "sample.bad.csv", "sample.power.csv", "sample.power.md", "sample.power.svg"}
    assert "`.venv/bin/python -m benchmarks run sample.power`" in (tmp_path / "sample.power.md").read_text()


def test_a_line_is_broken_between_branches_and_the_markers_of_the_lower_one_are_filled(tmp_path, monkeypatch):
    from matplotlib.axes import Axes

    drawn = []
    plain = Axes.plot
    monkeypatch.setattr(Axes, "plot", lambda self, *xy, **how: (drawn.append((xy, how)), plain(self, *xy, **how))[1])
    plot = Branches(
        "value", ("error",), across="side", lines="count", by="height", jump=0.5, least=7.0, filled="folded",
    )  # fmt: skip
    labels = {"count": "count", "side": "side", "height": "height"}
    places = ((1.0, 7.9), (2.0, 7.6), (4.0, 6.1), (8.0, 6.0))
    rows = [
        {"series": "", "value": x, "error": x, "time_s": 1.0, "status": "converged", "count": 1, "side": 0, "height": h}
        for x, h in places
    ]
    draw(replace(SAMPLE, plot=plot, labels=labels), rows, tmp_path / "a.svg")
    (line, white), (low, filled) = drawn
    assert np.array_equal(line[0], [1.0, 2.0, math.nan, 4.0, 8.0], equal_nan=True)
    assert white["markerfacecolor"] == "white"
    assert low[0] == [4.0, 8.0]
    assert "markerfacecolor" not in filled


@pytest.mark.parametrize("plot", [Curve(), Multiples("value", ("error", "count"), across="side", lines="count")])
def test_the_same_rows_give_the_same_figure_to_the_last_byte(tmp_path, plot):
    case = replace(SAMPLE, plot=plot, labels={"count": "count", "side": "side"})
    found = measured(SAMPLE, memory=False)
    rows = [{**row, "time_s": 0.1 * row["value"], "side": k % 2} for k, row in enumerate(found)]
    for name in ("a.svg", "b.svg"):
        draw(case, rows, tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
