"""What an FMU costs: one exchange, and a whole coupled solve, against the same solvers in this process."""

import contextlib
import functools
import statistics
import tempfile
import time

import scenes
from fmus.builder import build
from master.coupling import SCHEMES, FmuParticipant, solve

from .problems import BACKENDS, in_process
from .registry import Case, Curve, Outcome, Table

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


def median(work, repeats):
    """Median time of a call, s."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def repeated(fmu):
    """One exchange of an FMU with the inputs that it has: set every input block, step, get every interface output."""
    named = [name for name in fmu.blocks if name in ("displacement", "pressure", "shear", "line_load")]
    given = {name: fmu.get(name) for name in named if fmu.limits[name].causality == "input"}
    taken = [name for name in named if name not in given]

    def work():
        for name, values in given.items():
            fmu.set(name, values)
        fmu.step(0.0, DT)
        for name in taken:
            fmu.get(name)

    work()
    return work


def life_of_fmus(quick):
    """Markdown: what it costs to build the FMUs of every quasi-static scene, to load them and to step them."""
    rows = []
    still = [scene for scene in map(scenes.load, scenes.available()) if not scene.transient]
    for scene in still[: 1 if quick else None]:
        start = scene.with_trim({})
        with tempfile.TemporaryDirectory() as folder:
            made = median(lambda scene=scene, folder=folder, start=start: build(scene, folder, start), 3)
            for path in build(scene, folder, start):

                def loaded(path=path):
                    FmuParticipant(path).close()

                loaded()
                ready = median(loaded, 5)
                with FmuParticipant(path) as fmu:
                    step = median(repeated(fmu), 500)
                size = path.stat().st_size / 1e3
                rows.append(f"| {path.stem} | {size:.0f} | {made:.2f} | {1e3 * ready:.0f} | {1e6 * step:.0f} |")
    head = "| FMU | size, kB | build, s | load and initialise, ms | set, step, get, µs |\n|---|---|---|---|---|\n"
    return (
        head
        + "\n".join(rows)
        + (
            "\n\nBuild: all FMUs of the scene with their reference results, where the trim angle is known. Load: "
            "unpack, instantiate, initialise and free, in a process that has loaded one before. Set, step, get: the "
            "whole interface, inputs unchanged, so that no solver works. Medians."
        )
    )


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
    Table(name="exchange.fmus", title="What FMUs of quasi-static scenes cost beside their solvers", build=life_of_fmus),
)
