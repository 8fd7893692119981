"""A Newton iteration of membranes over their number: assembly, factorisation and memory, with two direct solvers."""

import contextlib
import functools
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from structural import Assembly, FaceLoad, Faces, Loads, Structure
from structural.solve import energy, linear
from structural.solve.statics import StaticProblem

from .membrane_models import airbag
from .memory import resident
from .registry import Table
from .text import lines, table

PRESSURE = 5000.0  # Pa
CELLS, QUICK = (15, 30, 60, 121), (8, 15)  # along a side: 900 ... 58564 triangles
# Iterations before those that are measured: from then on most of the airbag is under tension, and nothing is special.
BEFORE, MEASURED = 3, 5


def problem(n):
    """Static problem of the airbag with n x n cells, and its flat start."""
    nodes, fixed, group = airbag(n)
    structure = Structure(nodes, fixed, (group,), {"skin": Faces(group.nodes)})
    assembly = Assembly(structure)
    loads = Loads(np.zeros_like(nodes), {"skin": FaceLoad(np.full(len(group), PRESSURE))})
    return StaticProblem(assembly, assembly.prepare(loads), structure.groups), (assembly.unknowns.restrict(nodes), None)


class Stopwatch:
    """Seconds that calls of functions took, by name."""

    def __init__(self):
        self.spent = {}

    def around(self, name, function):
        """The function, timed under a name."""

        @functools.wraps(function)
        def timed(*args, **kwargs):
            begin = time.process_time()
            try:
                return function(*args, **kwargs)
            finally:
                self.spent.setdefault(name, []).append(time.process_time() - begin)

        return timed


@contextlib.contextmanager
def solved_by(solver, watch):
    """All factors by one direct solver, timed."""
    kept = linear.LARGE, energy.factorised
    linear.LARGE = 0 if solver == "PARDISO" else np.inf
    energy.factorised = watch.around("factors", energy.factorised)
    try:
        yield
    finally:
        linear.LARGE, energy.factorised = kept


def iterations(n, solvers):
    """Solver -> medians, s, of an iteration and of its parts; and the unknowns. The solvers take turns, an iteration
    each from the same place.
    """
    static, at = problem(n)
    newton = {solver: energy.EnergyNewton(static, at, 0.0, 1e-9, 1.0) for solver in solvers}
    watches = {solver: Stopwatch() for solver in solvers}
    whole = {solver: [] for solver in solvers}
    plain = static.residual_and_tangent
    for turn in range(BEFORE + MEASURED):
        for solver in solvers:
            watch = watches[solver] if turn >= BEFORE else Stopwatch()
            static.residual_and_tangent = watch.around("assembly", plain)
            begin = time.process_time()
            with solved_by(solver, watch):
                newton[solver].run(newton[solver].iterations + 1)
            if turn >= BEFORE:
                whole[solver].append(time.process_time() - begin)
    found = {
        solver: {"iteration": whole[solver], **watches[solver].spent} for solver in solvers
    }  # fmt: skip
    medians = {solver: {k: statistics.median(v) for k, v in parts.items()} for solver, parts in found.items()}
    return medians, len(at[0])


def peak(n, solver):
    """Growth of the resident memory, MB, up to its peak during set-up and two iterations, in a process of its own."""
    code = f"from benchmarks.membrane_solvers import grown; print(grown({n}, {solver!r}))"
    root = Path(__file__).resolve().parents[1]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    return float(done.stdout.split()[-1])


def grown(n, solver):
    """See `peak`, in this process."""
    before = resident("VmRSS")
    with solved_by(solver, Stopwatch()):
        energy.EnergyNewton(*problem(n), 0.0, 1e-9, 1.0).run(2)
    return resident("VmHWM") - before


def newton_iteration(quick):
    """Time of an iteration and its parts over the number of triangles, exponents, memory, and the solvers' ratio."""
    solvers = ("SuperLU", "PARDISO") if linear.has_pardiso() else ("SuperLU",)
    rows, sizes, times = [], [], {solver: [] for solver in solvers}
    for n in QUICK if quick else CELLS:
        medians, unknowns = iterations(n, solvers)
        sizes.append(4 * n * n)
        for solver in solvers:
            parts = medians[solver]
            times[solver].append(parts["iteration"])
            share = parts["factors"] / parts["iteration"]
            ratio = parts["iteration"] / medians["SuperLU"]["iteration"]
            row = [solver, 4 * n * n, unknowns, parts["iteration"], parts["assembly"], parts["factors"]]
            rows.append([*row, f"{100.0 * share:.0f}", f"{ratio:.2f}", f"{peak(n, solver):.0f}"])
    rows.sort(key=lambda row: solvers.index(row[0]))
    powers = [f"{np.polyfit(np.log(sizes), np.log(times[s]), 1)[0]:.2f} ({s})" for s in solvers]
    names = ["solver", "triangles", "unknowns", "iteration, s", "assembly, s", "factorisation, s"]
    names += ["factorisation, %", "iteration / SuperLU", "memory, MB"]
    missing = "" if "PARDISO" in solvers else " PARDISO is not installed: the extra `pardiso` brings it."
    return lines(
        table(names, rows),
        f"Fitted exponents, iteration ~ triangles^p: {', '.join(powers)}.",
        f"The airbag of `membranes.airbag`, iterations {BEFORE + 1} to {BEFORE + MEASURED} from flat, medians; the "
        "solvers take turns. Assembly: residual and consistent tangent with that of the pressure, unsymmetric in "
        "values and symmetric in pattern. The order of elimination and the places of all entries are found once for "
        "a structure; PARDISO keeps what it found out of the pattern too, SuperLU counts its fill anew in each "
        f"factorisation.{missing}",
    )


ENTRIES = (
    Table(
        name="membranes.newton",
        title="A Newton iteration of the square airbag over the number of triangles",
        build=newton_iteration,
    ),
)
