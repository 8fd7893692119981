"""All coupling schemes on all scenes, and what a quasi-Newton update costs the master."""

import contextlib
import functools

import numpy as np
from scipy.linalg import qr

import scenes
from master import IQNILS, compare
from master.studies.tables import markdown

from .registry import Case, Curve, Fit, Outcome, Table
from .text import lines

WINDS = (8, 12, 20)  # m/s, of the kites of the particle model
COLUMNS = 50


def schemes(quick):
    """Every scheme on every quasi-static scene that exists, both solvers in this process."""
    names = ["typical_section"] if quick else [n for n in scenes.available() if not scenes.load(n).transient]
    sweep = {} if quick else {"v3_kite.wind_speed": WINDS}
    rows = compare(names, sweep=sweep, jobs=0, repeat=1 if quick else 3)
    shown, _, legend = markdown(rows).partition("\n\n")
    told = (
        "Default parameters of every scheme, start at the trim angle, tolerances 1e-5 m and 0.01 N. One iteration of "
        "newton-krylov also takes some products with the Jacobian, which its time includes."
    )
    return lines(shown.split("\n"), legend.strip(), told)


@functools.cache
def columns(n):
    """Iterates (x, r) whose differences are random columns, and the pair of the update that is timed."""
    rng = np.random.default_rng(n)
    return rng.standard_normal((COLUMNS + 1, 2, n))


def differences(n):
    """V and W (n, columns) of the iterates, newest first."""
    x, r = np.moveaxis(columns(n), 1, 0)
    return np.diff(r, axis=0)[::-1].T, np.diff(x + r, axis=0)[::-1].T


@functools.cache
def least_squares(n):
    """The update by a dense least-squares solution."""
    V, W = differences(n)
    x, r = columns(n)[-1]
    return x + r - W @ np.linalg.lstsq(V, r, rcond=None)[0]


@contextlib.contextmanager
def update(series, n):
    """One update of IQN-ILS with its last column new, or a QR decomposition of all columns."""
    if series == "LAPACK QR":
        V, _ = differences(n)
        yield lambda: Outcome(least_squares(n), {"columns": qr(V, mode="economic", check_finite=False)[1].shape[1]})
        return
    scheme = IQNILS(reuse=0)
    scheme.begin([slice(None)])
    for x, r in columns(n)[:-1]:
        scheme.step(x, r)
    x, r = columns(n)[-1]

    def work():
        found = scheme.step(x, r)
        return Outcome(found, {"columns": scheme.columns})

    yield work


ENTRIES = (
    Table(
        name="coupling.schemes",
        title="Coupling schemes on all quasi-static scenes",
        build=schemes,
    ),
    Case(
        name="coupling.cost",
        title="One update of IQN-ILS with 50 columns, against one LAPACK QR of them",
        knob="unknowns",
        values=(1000, 3000, 10000, 30000),
        quick=(1000,),
        error="difference of the update, largest entry",
        unit="1",
        reference="dense least squares of all columns (numpy.linalg.lstsq)",
        prepare=update,
        truth=lambda series, n: least_squares(n),
        bound=1e-9,  # rounding times the condition of random columns, about 10, and entries of about 3
        series=("IQN-ILS", "LAPACK QR"),
        ratio_to="LAPACK QR",
        memory=False,
        plot=Curve("value", "time_s"),
        fit=Fit("value", "time_s", "time ~ unknowns"),
        labels={"columns": "columns"},
        note="The newest column is new; LAPACK QR is scipy.linalg.qr in economic mode, with Q.",
    ),
)
