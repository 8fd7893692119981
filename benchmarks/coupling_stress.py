"""Whether the coupling gives in: a thousand random problems, and ten thousand communication steps."""

import collections
import math
import time
import warnings

import numpy as np

from master.coupling import Exchange
from master.coupling.acceleration import IQNILS, IQNIMVJ, Aitken
from master.coupling.fixed_point import fixed_point
from master.coupling.march import march

from .problems import BACKENDS
from .random_problems import RandomProblem
from .registry import Table
from .text import lines, table

SEEDS = 1000
SCHEMES = (("IQN-ILS", IQNILS), ("IQN-IMVJ", IQNIMVJ), ("Aitken", Aitken))
STATUSES = ("converged", "max_iterations", "stalled", "diverged")
STEPS, SETTLED = 10_000, 100  # communication steps, and after how many the memory is taken as settled
GUST, PERIOD = 1.0, 10.0  # m/s and s, of the wind about 12 m/s


def outcomes(make, seeds):
    """(problem, result) of each seed; a warning is an exception and ends the study."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for seed in seeds:
            problem = RandomProblem(seed)
            yield problem, fixed_point(problem.G, problem.x0, make(), **problem.options)


def random(quick):
    """How schemes with default settings end on random problems."""
    rows = []
    for title, make in SCHEMES:
        for kind in ("linear", "nonlinear"):
            counted, evaluations, recovered = collections.Counter(), [], 0
            for problem, result in outcomes(make, range(20 if quick else SEEDS)):
                if problem.linear == (kind == "linear"):
                    counted[result.status] += 1
                    recovered += bool(result.converged and result.recoveries)
                    if result.converged:
                        evaluations.append(result.iterations)
            share = 100.0 * counted["converged"] / counted.total()
            quantiles = np.quantile(evaluations, (0.5, 0.95)) if evaluations else (math.nan, math.nan)
            row = [title, kind, counted.total(), f"{share:.1f} %", *(counted[s] for s in STATUSES[1:]), recovered]
            rows.append([*row, *(f"{q:.0f}" for q in quantiles)])
    head = ["scheme", "problems", "number", "converged", "max_iterations", "stalled", "diverged", "recovered"]
    told = (
        "At most 200 evaluations of G. n = 1 to 2000, up to 30 eigenvalues beyond the radius 0.3 and up to 50 in "
        "magnitude, of either sign and in complex pairs, coupled one way; up to four fields with scales up to 1e12 "
        "apart; tolerances 1e-8 to 1e-3; noise of up to a hundredth of them. `recovered` of the converged ones were "
        "restarted once or more. No exception and no warning in any of them."
    )
    return lines(table([*head, "median evaluations", "95 % below"], rows), told)


def resident():
    """Resident memory of this process, MB (Linux)."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


class Gust:
    """A coupling as an exchange that marches through a gust, with its states counted."""

    def __init__(self, coupling):
        pair = {"aero": coupling.aero, "structural": coupling.structural}
        self.exchange = Exchange(pair, coupling.connections, dt=0.1, rollback=True)
        self.aero = coupling.aero
        self.alive = self.saved = 0
        self.memory: list[float] = []
        for participant in pair.values():
            save, free = participant.save, participant.free
            participant.save = lambda save=save: self._booked(1, save)
            participant.free = lambda state, free=free: self._booked(-1, free, state)

    def _booked(self, change, function, *arguments):
        self.alive += change
        self.saved += change > 0
        return function(*arguments)

    def step(self, t, result):
        """The wind of the next communication step."""
        self.memory.append(resident())
        self.aero.set("wind_speed", 12.0 + GUST * math.sin(2.0 * math.pi * t / PERIOD))


def gust(quick):
    """Ten thousand communication steps of the V3 kite in a gust, as FMUs and in this process."""
    steps = 60 if quick else STEPS
    rows = []
    for title, make in BACKENDS.items():
        with make("v3_kite") as coupling:
            run = Gust(coupling)
            begin = time.perf_counter()
            result = march(run.exchange, IQNILS(), steps * run.exchange.dt, rtol=1e-6, callback=run.step)
            seconds = time.perf_counter() - begin
            settled, end = run.memory[min(SETTLED, steps // 2)], run.memory[-1]
            counts = [result.steps.count(s) for s in ("converged", "recovered")]
            bad = len(result.steps) - sum(counts)
            mean = float(np.mean(result.steps.iterations))
            growth = f"{100.0 * (end / settled - 1.0):.2f} %"
            freed = f"{run.saved - run.alive} of {run.saved}"
            rows.append([title, len(result.steps), *counts, bad, mean, 1e3 * seconds / steps, settled, growth, freed])
    head = ["participants", "steps", "converged", "recovered", "others", "mean evaluations", "ms a step"]
    head += [f"memory after {SETTLED}, MB", "growth to the end", "states freed"]
    told = (
        f"Wind of 12 m/s with a gust of {GUST:g} m/s and {PERIOD:g} s, communication steps of 0.1 s, each solved to "
        "1e-6 by IQN-ILS with linear prediction and rollback (the scene is quasi-static: its memory is the warm start)."
    )
    return lines(table(head, rows), told)


ENTRIES = (
    Table(name="coupling.random", title="Schemes with default settings on 1000 random problems", build=random),
    Table(name="coupling.gust", title="Ten thousand communication steps", build=gust),
)
