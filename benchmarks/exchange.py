"""What an FMU costs: one exchange, and a whole coupled solve, against the same solvers in this process."""

import contextlib
import functools

from master.coupling import solve
from master.schemes import SCHEMES

from .problems import BACKENDS, in_process
from .registry import Case, Curve, Outcome

DT = 1.0


def exchanged(coupling):
    """The structure under the loads of the start, and one exchange with the same loads again: set, step, get."""
    aero, structural = coupling.aero, coupling.structural
    aero.set("displacement", structural.get("displacement"))
    aero.step(0.0, DT)
    loads = {b: aero.get(b) for b, c in structural.causality.items() if c == "input"}

    def work():
        for block, values in loads.items():
            structural.set(block, values)
        structural.step(0.0, DT)
        return structural.get("displacement")

    return work, sum(v.size for v in loads.values())


@functools.cache
def displacement(strips):
    """The answer of the solvers in this process."""
    return exchanged(in_process("v3_kite", {"panels_per_section": strips // 9}))[0]()


@contextlib.contextmanager
def one_exchange(backend, strips):
    """One exchange whose inputs do not change: no solve, so that only the exchange is timed."""
    with BACKENDS[backend]("v3_kite", {"panels_per_section": strips // 9}) as coupling:
        work, inputs = exchanged(coupling)
        found = work()
        columns = {"inputs": inputs, "outputs": found.size, "scalars": inputs + found.size}

        def timed():
            return Outcome(work(), columns)

        yield timed


@functools.cache
def flown(speed):
    """The displacement of the coupled solve in this process."""
    return solve(in_process("v3_kite", wind_speed=speed), SCHEMES["iqn-ils"]()).displacement


@contextlib.contextmanager
def coupled_solve(backend, speed):
    """The whole coupled solve from the trim start."""
    with BACKENDS[backend]("v3_kite", wind_speed=speed) as coupling:

        def work():
            result = solve(coupling, SCHEMES["iqn-ils"]())
            columns = {"coupling_iterations": result.iterations, "solver_calls": 2 * coupling.evaluations}
            return Outcome(result.displacement, columns, result.status)

        yield work


# The same arithmetic on the same machine; 1e-12 m is rounding of positions of some 10 m.
SAME = 1e-12
COMMON = {
    "error": "difference of the displacement",
    "unit": "m",
    "reference": "the same solvers in this process",
    "bound": SAME,
    "series": tuple(BACKENDS),
    "ratio_to": "in-process",
}

ENTRIES = (
    Case(
        name="exchange.step",
        title="One exchange with the structure of the V3 kite: set loads, step, get displacements",
        knob="strips",
        values=(9, 18, 36, 72),
        quick=(9,),
        prepare=one_exchange,
        truth=lambda backend, strips: displacement(strips),
        loops=200,
        repeats=3,
        plot=Curve("scalars", "time_s", ("linear", "linear")),
        labels={"inputs": "inputs", "outputs": "outputs", "scalars": "scalars exchanged"},
        note="The inputs do not change, so that neither solver works and the exchange alone is timed.",
        **COMMON,
    ),
    Case(
        name="exchange.coupled",
        title="Coupled solve of the V3 kite from the trim start, two FMUs against in-process",
        knob="wind, m/s",
        values=(8.0, 12.0, 20.0),
        quick=(12.0,),
        prepare=coupled_solve,
        truth=lambda backend, speed: flown(speed),
        repeats=5,
        plot=Curve("value", "time_s", ("linear", "linear")),
        labels={"coupling_iterations": "coupling iterations", "solver_calls": "solver calls"},
        note="IQN-ILS, default tolerances; building and loading the FMUs is not timed.",
        **COMMON,
    ),
)
