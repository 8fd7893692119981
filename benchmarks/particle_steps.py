"""Cost of implicit steps: chains up to 10 000 particles and nets up to 10 000 nodes."""

import contextlib
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from structural import Assembly, Chains, Loads, Structure
from structural.dynamics import BDF2, GeneralisedAlpha, ImplicitEuler, Motion, integrate

from .nets import saddle
from .particle_models import G
from .registry import Case, Curve, Fit, Outcome

SCHEMES = {
    "linear implicit Euler": ImplicitEuler(linear=True),
    "implicit Euler": ImplicitEuler(),
    "generalised-alpha": GeneralisedAlpha(0.5),
    "BDF2": BDF2(),
}
STEP = 1e-3  # s


def chain(n):
    """A taut tether of 300 m with n particles: 2933 N/m, 3.6 kg, stretched by 0.5 %, plucked by gravity across it."""
    x = np.zeros((n, 3))
    x[:, 0] = np.linspace(0.0, 301.5, n)
    e = n - 1
    links, fixed = np.stack([np.arange(e), np.arange(1, n)], axis=1), np.zeros((n, 3), dtype=bool)
    fixed[[0, -1]] = True
    k = np.full(e, 2933.3 * e)
    chains = (Chains(links, np.full(e, 300.0 / e), k, np.zeros(e, bool), (), 7.7e-4 * k),)
    mass = np.full(n, 3.6 / e)
    return _motion(Structure(x, fixed, chains, sp.csr_array((0, n)), np.zeros((0, 4), int)), chains, mass)


def square(n):
    """The saddle net with about n nodes, rest lengths halved, 10 g a node, plucked by gravity."""
    g = round(0.5 + np.sqrt(0.5 * n - 0.25))
    s = saddle(g, 0.5, False)
    chains = tuple(replace(c, c=0.01 * c.k) for c in s.chains)
    return _motion(s, chains, np.full(len(s.nodes), 0.01))


def _motion(structure, chains, mass):
    dead = np.outer(mass, [0.0, 0.0, -G])
    motion = Motion(Assembly(structure), mass, chains, Loads(np.zeros(0), None, dead))
    return motion, motion.at(structure.nodes)


def _steps(model, count):
    made = {}

    @contextlib.contextmanager
    def prepare(series, n):
        if n not in made:
            made[n] = model(n)
        motion, start = made[n]
        # on its way: the first steps from rest are the easy ones
        under_way = integrate(motion, start, 2 * STEP, SCHEMES[series], STEP).state

        def work():
            end = integrate(motion, under_way, under_way.t + count * STEP, SCHEMES[series], STEP)
            columns = {"newton_iterations": end.newton_iterations / count, "unknowns": motion.unknowns.count}
            return Outcome(0.0, columns, "converged" if end.finished else end.status)

        yield work

    return prepare


def _case(name, title, model, values, count):
    return Case(
        name=name,
        title=title,
        knob="particles",
        values=values,
        quick=values[:1],
        error="none",
        unit="1",
        reference="none: cost only",
        prepare=_steps(model, count),
        truth=lambda series, value: 0.0,
        bound=0.0,
        series=tuple(SCHEMES),
        repeats=5,
        memory=False,
        plot=Curve("value", "time_s"),
        fit=Fit("value", "time_s", f"time of {count} steps ~ particles", least=1000),
        labels={"newton_iterations": "Newton iterations a step", "unknowns": "unknowns"},
        note=f"Times are those of {count} steps of {1e3 * STEP:g} ms.",
    )


ENTRIES = (
    _case("particles.chain_steps", "Implicit steps of a chain", chain, (100, 300, 1000, 3000, 10000), 10),
    _case("particles.net_steps", "Implicit steps of a net", square, (100, 300, 1000, 3000, 10000), 4),
)
