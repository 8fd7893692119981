"""Cost of implicit steps: chains up to 10 000 particles and nets up to 10 000 nodes."""

import statistics
import time
from dataclasses import replace

import numpy as np

from structural import Assembly, Chains, Loads, Structure
from structural.dynamics import BDF2, GeneralisedAlpha, ImplicitEuler, Motion, integrate

from .nets import saddle
from .particle_models import G
from .registry import Table
from .text import lines, table

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
    return _motion(Structure(x, fixed, chains), chains, mass)


def square(n):
    """The saddle net with about n nodes, rest lengths halved, 10 g a node, plucked by gravity."""
    g = round(0.5 + np.sqrt(0.5 * n - 0.25))
    s = saddle(g, 0.5, False)
    chains = tuple(replace(c, c=0.01 * c.k) for c in s.groups)
    return _motion(s, chains, np.full(len(s.nodes), 0.01))


def _motion(structure, chains, mass):
    dead = np.outer(mass, [0.0, 0.0, -G])
    motion = Motion(Assembly(structure), mass, Loads(dead), chains)
    return motion, motion.at(structure.nodes)


def per_step(model, scheme, n, count, repeats=3):
    """Median time s and Newton iterations of a step of n particles on their way: the first steps from rest are easy."""
    motion, start = model(n)
    under_way = integrate(motion, start, 2 * STEP, scheme, STEP).state
    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        end = integrate(motion, under_way, under_way.t + count * STEP, scheme, STEP)
        seconds.append((time.perf_counter() - begin) / count)
        if not end.finished:
            raise RuntimeError(end.message)
    return statistics.median(seconds), end.newton_iterations / count


def _table(model, values, count):
    def build(quick):
        sizes = values[:3] if quick else values
        found = {(s, n): per_step(model, scheme, n, count) for s, scheme in SCHEMES.items() for n in sizes}
        rows = [[n, *(f"{1e3 * found[s, n][0]:.2f} ({found[s, n][1]:.1f})" for s in SCHEMES)] for n in sizes]
        n, far = np.array(sizes[-2:], float), {s: [found[s, k][0] for k in sizes[-2:]] for s in SCHEMES}
        exponents = ", ".join(f"{np.log(t[1] / t[0]) / np.log(n[1] / n[0]):.2f} ({s})" for s, t in far.items())
        return lines(
            table(["particles", *(f"{s}: ms a step (iterations)" for s in SCHEMES)], rows),
            f"Steps of {1e3 * STEP:g} ms. Time ~ particles^p between the last two rows: {exponents}.",
        )

    return build


VALUES = (100, 300, 1000, 3000, 10_000)
ENTRIES = (
    Table("particles.chain_steps", "Cost of implicit steps of a chain of particles", _table(chain, VALUES, 10)),
    Table("particles.net_steps", "Cost of implicit steps of a net of particles", _table(square, VALUES, 4)),
)
