"""Integrators: error of the positions against run time, for a swinging chain and for the tether in the wind."""

import functools
import time

import numpy as np
from scipy.integrate import solve_ivp

from structural.dynamics import BDF2, GeneralisedAlpha, ImplicitEuler, Motion, integrate

from .particle_models import DIAMETER, LENGTH, MODULUS, G, row, straight, wind
from .plots import STYLES
from .registry import Table
from .text import PYTHON, lines, table

SCHEMES = {
    "implicit Euler, linear": ImplicitEuler(linear=True),
    "implicit Euler": ImplicitEuler(),
    "generalised-alpha 1": GeneralisedAlpha(1.0),
    "generalised-alpha 0.5": GeneralisedAlpha(0.5),
    "generalised-alpha 0": GeneralisedAlpha(0.0),
    "BDF2": BDF2(),
}
PENDULUM, TETHER = "swinging chain", "tether in wind"
DURATION = 1.0  # s, of both
STEPS = tuple(0.02 / 2**i for i in range(6))  # s
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6)  # m a step


def _moving(s):
    motion = Motion(s.assembly, s.mass, s.loads, s.groups)
    return motion, motion.at(s.x)


@functools.cache
def problem(name):
    """Equations of motion and the state at the beginning.

    The chain: 10 particles of 0.1 kg below a fixed one, 0.1 m apart, springs of 2000 N/m without dampers, let go at
    45 degrees. The tether: that of scenes/tether_in_wind, 25 particles, straight when the wind begins.
    """
    if name == PENDULUM:
        x = straight(11, 1.0) @ np.array([[1.0, 0.0, -1.0], [0.0] * 3, [0.0] * 3]) * np.sqrt(0.5)
        dead = np.tile([0.0, 0.0, -0.1 * G], (11, 1))
        return _moving(row(x, 2000.0, 0.1, dead=dead, mass=0.1, free_end=True))
    n = 25
    mass = np.full(n, 0.012 * LENGTH / (n - 1))
    mass[[0, -1]] *= 0.5
    k = MODULUS * 0.25 * np.pi * DIAMETER**2 / LENGTH * (n - 1)
    return _moving(row(straight(n, LENGTH, 2), k, LENGTH / (n - 1), 7.7e-4 * k, False, wind=wind(), mass=mass))


@functools.cache
def reference(name):
    """Unknowns (u,) m at the end, by the explicit method DOP853 of scipy to 1e-12 of the positions."""
    motion, start = problem(name)
    u = motion.unknowns.count

    def rates(t, y):
        return np.concatenate([y[u:], motion.acceleration(y[:u], y[u:], t)])

    y = np.concatenate([start.q, start.v])
    end = solve_ivp(rates, (0.0, DURATION), y, "DOP853", rtol=1e-12, atol=1e-12)
    if not end.success:
        raise RuntimeError(end.message)
    return end.y[:u, -1]


def run(name, scheme, **how):
    """Error m of the positions at the end, time s, steps, Newton iterations; an infinite error where it did not end."""
    motion, start = problem(name)
    begin = time.perf_counter()
    end = integrate(motion, start, DURATION, SCHEMES[scheme], **how)
    took = time.perf_counter() - begin
    error = float(np.abs(end.state.q - reference(name)).max()) if end.finished else np.inf
    return error, took, end.steps, end.newton_iterations


@functools.cache
def measured(name, quick=False):
    """scheme -> (fixed, adaptive): lists of what `run` returns for every step and every tolerance."""
    reference(name)
    steps, tolerances = (STEPS[:3], TOLERANCES[:2]) if quick else (STEPS, TOLERANCES)
    return {
        scheme: ([run(name, scheme, step=h) for h in steps], [run(name, scheme, tolerance=a) for a in tolerances])
        for scheme in SCHEMES
    }


def orders(fixed):
    """Observed orders between steps of half the size."""
    e = np.array([error for error, *_ in fixed])
    return np.log2(e[:-1] / e[1:])


def _tables(quick):
    text = []
    for name in (PENDULUM, TETHER):
        rows = []
        for scheme, (fixed, adaptive) in measured(name, quick).items():
            shown = [f"{e:.1e} / {1e3 * t:.0f}" for e, t, *_ in (fixed[0], fixed[len(fixed) // 2], fixed[-1])]
            controlled = [f"{e:.1e} / {1e3 * t:.0f} / {n}" for e, t, n, _ in (adaptive[0], adaptive[-1])]
            rows.append([scheme, *shown, " ".join(f"{p:.2f}" for p in orders(fixed)), *controlled])
        used = STEPS[:3] if quick else STEPS
        ends = (TOLERANCES[:2] if quick else TOLERANCES)[:: 1 if quick else len(TOLERANCES) - 1]
        heads = ["scheme", *(f"h = {1e3 * h:.3g} ms" for h in (used[0], used[len(used) // 2], used[-1])), "orders",
                 *(f"tolerance {a:g} m" for a in ends)]  # fmt: skip
        text += [f"{name.capitalize()}: error m / ms (/ steps).", "\n".join(table(heads, rows))]
    text.append(
        "Largest error of a coordinate after 1 s against DOP853 with rtol and atol 1e-12, orders from one halving of "
        "the step to the next. Chain: 10 particles of 0.1 kg, 1 m, springs of 2000 N/m, let go at 45°. Tether: 300 m "
        "in 24 segments across 6 m/s, lines that cannot push, started straight and without tension."
    )
    return lines(text[:1], *text[1:])


def picture(path):
    """Error over run time, both problems: fixed steps solid, adaptive ones dotted."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        look = {"svg.hashsalt": "particles.integrators", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3}
        matplotlib.rcParams.update(look)
        figure = Figure(figsize=(9.0, 4.2), layout="constrained")
        for axes, name in zip(figure.subplots(1, 2), (PENDULUM, TETHER), strict=True):
            for style, (scheme, both) in zip(STYLES, measured(name).items(), strict=True):
                for dash, runs in zip(("-", ":"), both, strict=True):
                    good = np.array([(1e3 * t, e) for e, t, *_ in runs if np.isfinite(e)])
                    how = {**style, "linestyle": dash, "linewidth": 1.0, "markersize": 4.0, "markerfacecolor": "white"}
                    axes.plot(*good.T, label=scheme if dash == "-" else None, **how)
            axes.set(xscale="log", yscale="log", xlabel="time, ms", ylabel="error of positions, m", title=name)
        axes.legend(fontsize=7, framealpha=0.9)
        figure.suptitle("Integrators: fixed steps (solid) and error control (dotted)", fontsize=10)
        figure.supxlabel(f"{PYTHON} -m benchmarks run particles.integrators", fontsize=6.5, color="0.35")
        figure.savefig(path, format=path.suffix[1:], metadata={"Date": None} if path.suffix == ".svg" else None)


ENTRIES = (Table("particles.integrators", "Integrators: error against run time", _tables, picture),)
