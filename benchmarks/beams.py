"""Beams and inflated tubes: run time against error over elements, and beams made of springs beside them."""

import contextlib
import functools
import time

import numpy as np
from scipy.optimize import brentq

from structural import (
    Assembly,
    Chains,
    LinearSection,
    Loads,
    Structure,
    breukels_tube,
    collapse_deflection,
    equilibrium,
    tip_load,
)

from .cantilevers import arc, cantilever, elastica, straight, tip_loaded
from .plots import STYLES
from .registry import Case, Curve, Fit, Outcome, Table
from .text import PYTHON, lines, table

PRESSURE, RADIUS = 0.3e5, 0.1  # Pa, m
PARTS = {"half the collapse load": 0.5, "97 % of the collapse load": 0.97}
LABELS = {"unknowns": "unknowns", "newton_iterations": "Newton iterations"}


def _outcome(found, answer):
    unknowns = 6 * (len(found.x) - 1)
    return Outcome(answer, {"unknowns": unknowns, "newton_iterations": found.iterations}, found.status)


def _deflection(found):
    """Deflection and shortening of the tip of a cantilever of 1 m, m."""
    return np.array([found.x[-1, 1], 1.0 - found.x[-1, 0]])


def bar(count, load):
    """Equilibrium of a cantilever of 1 m and 1 N m^2 that hardly stretches under a tip load N, in one load step."""
    s = cantilever(straight(count), LinearSection.of(count, 1e6, 1.0, 1.0))
    return tip_loaded(s, (0.0, load, 0.0), atol=1e-9)


@contextlib.contextmanager
def deflected(series, count):
    """The elastica under 10 N."""

    def work():
        found = bar(count, 10.0)
        return _outcome(found, _deflection(found))

    yield work


def bend(count):
    """Equilibrium of the bend of 45 degrees under 600 out of its plane (Bathe and Bolourchi 1979), torsion as 2 I."""
    e = 1e7
    section = LinearSection.of(count, e, e / 12.0, e / 12.0, kGA=0.5 * e * 5.0 / 6.0)
    s = cantilever(arc(count), section, across=(0.0, 0.0, 1.0))
    return tip_loaded(s, (0.0, 0.0, 600.0), steps=3, atol=1e-6)


@functools.cache
def bend_reference():
    """Tip of the bend from 64 and 128 elements, extrapolated in h^2."""
    return (4.0 * bend(128).x[-1] - bend(64).x[-1]) / 3.0


@contextlib.contextmanager
def bent(series, count):
    """The bend of 45 degrees, in three load steps."""

    def work():
        found = bend(count)
        return _outcome(found, found.x[-1])

    yield work


@functools.cache
def measured(series):
    """Tip load N of a series and the tip deflection m that the fits have there."""
    collapse = collapse_deflection(PRESSURE, RADIUS)
    load = PARTS[series] * tip_load(PRESSURE, RADIUS, collapse)
    return load, brentq(lambda v: tip_load(PRESSURE, RADIUS, v) - load, 0.0, collapse, xtol=1e-15)


@contextlib.contextmanager
def inflated(series, count):
    """An inflated cantilever of 1 m; the answer is its tip deflection relative to that of the fits."""
    load, deflection = measured(series)

    def work():
        s = cantilever(straight(count), breukels_tube(PRESSURE, np.full(count, RADIUS)))
        found = tip_loaded(s, (0.0, load, 0.0), atol=1e-8)
        return _outcome(found, found.x[-1, 1] / deflection)

    yield work


def spring_cells(count, factor):
    """A cantilever of 1 m and 1 N m^2 as a row of cubes of springs, clamped at its first four particles.

    Every cube of side l has springs along its 12 edges and across its 6 faces twice, 24 in all (LEI thesis, figure
    2.10); four particles and 24 springs a segment, so that inner faces have theirs twice. k = EI / (factor l^3).
    """
    side = 1.0 / count
    square = side * np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    nodes = np.array([(i * side, *corner) for i in range(count + 1) for corner in square])
    cell = [(0, 2), (1, 3), (4, 6), (5, 7)]
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
        cell += [(a, a + 4), (a, b), (a + 4, b + 4), (a, b + 4), (b, a + 4)]
    links = (4 * np.arange(count)[:, None, None] + np.array(cell)).reshape(-1, 2)
    l0 = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    springs = Chains(links, l0, np.full(len(links), 1.0 / (factor * side**3)), np.ones(len(links), dtype=bool))
    fixed = np.zeros((len(nodes), 3), dtype=bool)
    fixed[:4] = True
    return Structure(nodes, fixed, (springs,))


def spring_tip(count, factor, load):
    """Status, w / L and u / L of the centre of the last four particles of `spring_cells` under a tip load N."""
    s = spring_cells(count, factor)
    dead = np.zeros_like(s.nodes)
    dead[-4:, 1] = 0.25 * load
    found = equilibrium(Assembly(s), Loads(dead), s.nodes, atol=1e-8)
    end = found.x[-4:].mean(axis=0)
    return found.status, np.array([end[1], 1.0 - end[0]])


def beam_tip(count, load):
    """Status, w / L and u / L of beams."""
    found = bar(count, load)
    return found.status, _deflection(found)


# In pure bending a long row of these cubes has EI = 4/3 k l^3 (found: 1.337 at 20 cubes, 1.366 at 2); the thesis has
# 2.4, which would take every spring twice.
CUBE, THESIS = 4.0 / 3.0, 2.4
MODELS = {
    "springs, 2 cells": (functools.partial(spring_tip, 2, CUBE), 24, 48),
    "springs, 5 cells": (functools.partial(spring_tip, 5, CUBE), 60, 120),
    "springs, 5 cells, k = EI / 2.4 l³": (functools.partial(spring_tip, 5, THESIS), 60, 120),
    "beams, 1 element": (functools.partial(beam_tip, 1), 6, 1),
    "beams, 3 elements": (functools.partial(beam_tip, 3), 18, 3),
}
NAMES = ("model", "unknowns", "elements", "Δw/L, load ≤ 3", "Δw/L, load ≤ 10", "Δu/L, load ≤ 10", "time at 10, ms")


@functools.cache
def _followed(name, count):
    """Loads PL^2 / EI and w / L, u / L (count, 2) of a model; nan where it did not converge."""
    loads = np.linspace(0.0, 10.0, count + 1)[1:]
    found = [MODELS[name][0](load) for load in loads]
    return loads, np.array([tip if status == "converged" else (np.nan, np.nan) for status, tip in found])


def springs_and_beams(quick):
    """A row a model: largest differences to the elastica, and the time of one solve from the straight beam."""
    rows = []
    for name, (tip, unknowns, elements) in MODELS.items():
        loads, found = _followed(name, 10 if quick else 40)
        exact = np.array([elastica(load)[:2] for load in loads])
        away = np.abs(found - exact)
        begin = time.perf_counter()
        tip(10.0)
        took = 1e3 * (time.perf_counter() - begin)
        worst = (away[loads <= 3.0, 0].max(), *away.max(axis=0))
        rows.append([name, str(unknowns), str(elements), *(f"{v:.4f}" for v in worst), f"{took:.1f}"])
    return lines(
        table(NAMES, rows),
        "Largest differences to the elastica over the load PL²/EI. Cubes of 24 springs, their side the length of the "
        "beam over their number (LEI thesis 3.2, figures 2.10 and 3.2), with k = EI / (4/3 l³): a long row of them has "
        "this EI in pure bending; with the 2.4 of the thesis it bends 1.8 times as much. Beams are Euler–Bernoulli. "
        "Every solve is one load step from the straight beam.",
    )


def picture(path):
    """w / L and u / L over the load for springs, beams and the elastica (LEI thesis figure 3.3)."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update({"svg.hashsalt": "beams.psm", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3})
        figure = Figure(figsize=(8.4, 3.9), layout="constrained")
        both = figure.subplots(1, 2)
        exact_loads = np.linspace(1e-3, 10.0, 200)
        exact = np.array([elastica(load)[:2] for load in exact_loads])
        for k, (axes, word) in enumerate(zip(both, ("deflection w / L", "shortening u / L"), strict=True)):
            axes.plot(exact_loads, exact[:, k], color="0.6", linewidth=3.0, label="elastica")
            for style, name in zip(STYLES, MODELS, strict=False):
                loads, found = _followed(name, 40)
                look = {**style, "markersize": 4.0, "linewidth": 1.0, "markerfacecolor": "white", "markevery": 4}
                axes.plot(loads, found[:, k], label=name, **look)
            axes.set_xlabel("load PL² / EI")
            axes.set_ylabel(word)
        both[1].legend(fontsize=7.5, framealpha=0.9)
        figure.suptitle("A cantilever of springs or of beams under a tip load", fontsize=10)
        figure.supxlabel(f"{PYTHON} -m benchmarks run beams.psm", fontsize=6.5, color="0.35")
        figure.savefig(path, format=path.suffix[1:], metadata={"Date": None} if path.suffix == ".svg" else None)


ENTRIES = (
    Case(
        name="beams.elastica",
        title="Cantilever under PL²/EI = 10: error of the tip over elements",
        knob="elements",
        values=(1, 2, 3, 4, 6, 8),
        quick=(2, 4, 8),
        error="error of the tip / length",
        unit="1",
        reference="elliptic integrals (elastica)",
        prepare=deflected,
        truth=lambda series, count: elastica(10.0)[:2],
        bound=5e-5,
        finer="larger",
        plot=Curve("value", "error"),
        fit=Fit("value", "error", "error ~ elements", least=2.0),
        labels=LABELS,
        note="One load step from the straight beam; EA = 10⁶ EI/L², so that 10⁻⁵ of it is stretch.",
    ),
    Case(
        name="beams.bend",
        title="Bend of 45° under 600 out of its plane: error of the tip over elements",
        knob="elements",
        values=(2, 4, 8, 16, 32, 64),
        quick=(4, 8, 16),
        error="error of the tip",
        unit="m",
        reference="64 and 128 elements, extrapolated in h²",
        prepare=bent,
        truth=lambda series, count: bend_reference(),
        bound=5e-3,
        finer="larger",
        repeats=5,
        plot=Curve("value", "error"),
        fit=Fit("value", "error", "error ~ elements", least=4.0),
        labels=LABELS,
        note="Radius 100, unit square section, E = 10⁷, ν = 0, torsion constant 2 I (Bathe and Bolourchi 1979; Simo "
        "and Vu-Quoc 1986), three load steps. Straight elements stand for arcs, so that the error falls with h².",
    ),
    Case(
        name="tubes.cantilever",
        title="Inflated cantilever of 1 m, 0.3 bar, radius 0.1 m: tip deflection against Breukels' fit",
        knob="elements",
        values=(1, 2, 5, 10, 20),
        quick=(1, 2),
        error="error of the tip deflection",
        unit="1",
        reference="the fit of tip load over tip deflection (Breukels 2011)",
        prepare=inflated,
        truth=lambda series, count: 1.0,
        bound=0.01,
        series=tuple(PARTS),
        repeats=5,
        plot=Curve("value", "error"),
        labels=LABELS,
        note="One load step from the straight tube. The law in moment and curvature does not depend on the division: "
        "what remains is how much a bent cantilever shortens its own lever.",
    ),
    Table("beams.psm", "A cantilever of springs and of beams against the elastica", springs_and_beams, picture),
)
