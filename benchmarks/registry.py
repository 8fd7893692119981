"""What there is to measure: the declarations `Case` and `Table`, and the modules that hold them."""

import importlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

SUBJECTS = (
    "v3_flown",
    "v3_aero",
    "v3_coupled",
    "v3_coupled_tables",
    "v3_range",
    "coupling_reference",
    "coupling_schemes",
    "coupling_stress",
    "network_stress",
    "kite_stress",
    "motion_stress",
    "fmu_fuzz",
    "fmu_cycles",
    "run_stress",
    "typical_section",
    "saddle",
    "beams",
    "membranes",
    "membrane_kratos",
    "membrane_solvers",
    "membrane_tubes",
    "panel_bodies",
    "panel_peers",
    "panel_fmus",
    "parafoils",
    "ballooned_wings",
    "v3_detailed",
    "hanging",
    "exchange",
    "scalars",
    "particle_cells",
    "particle_validation",
    "particle_steps",
    "particle_coupled",
    "particle_kite",
    "particle_hencky",
    "particle_nets",
    "particle_scaling",
    "particle_integrators",
)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one solve gave: the `answer` whose error is taken, further CSV `columns` (counts first), its `status`."""

    answer: Any
    columns: dict[str, Any] = field(default_factory=dict)
    status: str = "converged"


@dataclass(frozen=True)
class Curve:
    """One diagram of a column over another, a line a series; axes are "log" or "linear"."""

    x: str = "time_s"
    y: str = "error"
    scales: tuple[str, str] = ("log", "log")


@dataclass(frozen=True)
class Multiples:
    """A grid of small diagrams: rows are the columns `ys`, columns the values of `across`, lines those of `lines`."""

    x: str
    ys: tuple[str, ...]
    across: str
    lines: str


@dataclass(frozen=True)
class Branches(Multiples):
    """Small multiples of solutions on several branches, told apart by the column `by`.

    A line is broken where `by` changes by more than `jump` between neighbours; where it is below `least`, the marker is
    filled, and `filled` says in the legend what that means.
    """

    by: str
    jump: float
    least: float
    filled: str


@dataclass(frozen=True)
class Fit:
    """Exponent p of y ~ x^p per series, by least squares in logarithms over points with x >= `least`, y > `floor`.

    `law` says it in words, as "time ~ nodes".
    """

    x: str
    y: str
    law: str
    least: float = 0.0
    floor: float = 0.0


def largest_difference(answer, truth):
    """max |answer - truth|, in their unit."""
    return float(np.max(np.abs(np.asarray(answer, float) - np.asarray(truth, float))))


@dataclass(frozen=True)
class Case:
    """A problem, an accuracy knob with its values, a reference, and what is measured.

    `prepare(series, value)` is a context manager, entered anew before every measurement and not timed itself; it
    yields the work, a callable without arguments that is timed and returns an `Outcome`. `truth(series, value)` is the
    answer to compare with and `reference` says in words where it comes from; `distance(answer, truth)` is the error,
    `further(answer, truth)` gives columns of other errors. Status and error are judged: every status is one of
    `statuses`, and every converged error at most `bound` (with `finer`, the direction of the knob in which the error
    falls, only at the finest value). `loops` calls of the work make one measurement where it is short, and without
    `memory` that is not measured. `ratio_to` names the series whose time, measured in turn with the others, divides
    theirs. `labels` name the columns of the outcome, with units.
    """

    name: str
    title: str
    knob: str
    values: tuple
    quick: tuple
    error: str
    unit: str
    reference: str
    prepare: Callable[[str, Any], AbstractContextManager[Callable[[], Outcome]]]
    truth: Callable[[str, Any], Any]
    bound: float
    distance: Callable[[Any, Any], float] = largest_difference
    further: Callable[[Any, Any], dict[str, float]] = lambda answer, truth: {}
    finer: Literal["larger", "smaller"] | None = None
    series: tuple[str, ...] = ("",)
    quick_series: tuple[str, ...] | None = None
    statuses: tuple[str, ...] = ("converged",)
    repeats: int = 9
    memory: bool = True
    loops: int = 1
    ratio_to: str | None = None
    plot: Curve | Multiples = Curve()
    fit: Fit | None = None
    labels: dict[str, str] = field(default_factory=dict)
    note: str = ""

    def points(self, quick=False):
        """All (series, value) to measure; fewer with `quick`."""
        series = self.quick_series if quick and self.quick_series is not None else self.series
        return [(s, v) for s in series for v in (self.quick if quick else self.values)]


@dataclass(frozen=True)
class Table:
    """A comparison that is no work-precision case: `build(quick)` returns markdown, `title` says what it shows, and
    `draw(path)` writes its figure as SVG where it has one.
    """

    name: str
    title: str
    build: Callable[[bool], str]
    draw: Callable[[Path], None] | None = None


def registered():
    """Name -> case or table, in the order of `SUBJECTS`."""
    entries: dict[str, Case | Table] = {}
    for subject in SUBJECTS:
        for entry in importlib.import_module(f"benchmarks.{subject}").ENTRIES:
            if entry.name in entries:
                raise ValueError(f"two entries are named {entry.name}; rename one.")
            entries[entry.name] = entry
    return entries


def chosen(names):
    """The entries with these names, or whose name begins with one and a dot; all without names."""
    entries = registered()
    for name in names or ():
        if not any(matches(key, name) for key in entries):
            raise ValueError(f"there is no case or table {name}; `.venv/bin/python -m benchmarks list` shows them.")
    return [e for key, e in entries.items() if not names or any(matches(key, name) for name in names)]


def matches(key, name):
    """Whether an entry's name is `name` or lies below it."""
    return key == name or key.startswith(f"{name}.")
