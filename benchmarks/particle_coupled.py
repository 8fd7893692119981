"""A tether and the wind on it, coupled in time: order of the schemes, and what the inertia of the air does to them."""

import functools
from pathlib import Path

import numpy as np

from master.coupling import InProcessParticipant, simulate
from scenes import load

from .registry import Table
from .text import lines, table

END = 3.0  # s: the tether is on its way, over the kink where it becomes taut
STEPS = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
REFERENCE = 2.5e-4  # s, implicit, whose own error is a sixteenth of that of the finest step
SCHEMES = ("explicit", "aitken", "iqn-ils")
# The tether starts blown out: without the jerk of becoming taut its motion is smooth, and orders show.
BLOWN = 6.0  # m; in the gust the tether reaches 4.7 m
SMOOTH = {"wind_speed": 6.0, "gust_speed": 3.0, "gust_duration": 4.0, "start_in_equilibrium": 1.0}


def sides(scene, parameters):
    """The two participants of a scene in this process."""
    cores = sorted(scene.cores().items())
    return {
        side: InProcessParticipant(core, {k: v for k, v in parameters.items() if k in core.names}, side)
        for side, core in cores
    }


def coupled(scheme, step, tolerance=1e-9, end=END, parameters=None, **settings):
    """Simulation and positions m at the end of the tether in a gust, with communication steps of `step` s, each of them
    one step of the integration.
    """
    scene = load("tether_in_wind", settings)
    pair = sides(scene, SMOOTH | {"longest_step": step} | (parameters or {}))
    run = simulate(pair, end, step, scheme, "serial", tolerance, 60)
    return run, pair["structural"].get("position")


@functools.cache
def reference(end=END):
    """Positions m at the end by implicit steps that are finer than all others."""
    run, x = coupled("aitken", REFERENCE, 1e-10, end)
    if not run.finished:
        raise RuntimeError(run.message)
    return x


@functools.cache
def errors(scheme, steps, end=END):
    """Communication step -> largest error m of a position at the end, and evaluations a step."""
    out = {}
    for step in steps:
        run, x = coupled(scheme, step, end=end)
        error = float(np.linalg.norm(x - reference(end), axis=1).max()) if run.finished else np.nan
        out[step] = error, run.evaluations / max(len(run.steps), 1)
    return out


def _orders(quick):
    steps = STEPS[:3] if quick else STEPS
    found = {scheme: errors(scheme, steps) for scheme in SCHEMES}
    rows = []
    for i, step in enumerate(steps):
        row = [f"{step:g}"]
        for of in found.values():
            error, evaluations = of[step]
            order = ""
            if i:
                before = of[steps[i - 1]][0]
                order = f" ({np.log(before / error) / np.log(steps[i - 1] / step):.2f})"
            row += [f"{error:.2e}{order}", f"{evaluations:.1f}"]
        rows.append(row)
    heads = ["communication step s", *(h for s in SCHEMES for h in (f"{s}: error m (order)", "evaluations"))]
    return lines(
        table(heads, rows),
        f"Largest error of a position after {END:g} s in a gust of 3 m/s on 6 m/s, against implicit steps of "
        f"{REFERENCE:g} s. Explicit: loads of the shape at the beginning of a step act all through it. Implicit: loads "
        "go linearly from those of the step before to those of the motion at its end.",
    )


def _added_mass(_quick):
    """Ratio of masses -> how each scheme ends."""
    rows = []
    for ratio in (0.5, 0.9, 1.1, 1.5, 2.0, 10.0):
        row = [f"{ratio:g}"]
        for scheme in ("explicit", "aitken", "iqn-ils"):
            for step in (0.1, 0.01):
                run, x = with_added_mass(scheme, ratio, step)
                end = np.abs(x[:, 0]).max()
                good = run.finished and end < BLOWN
                per_step = run.evaluations / max(len(run.steps), 1)
                row.append(f"{end:.3f} m, {per_step:.1f}" if good else f"unstable after {run.time:g} s")
        rows.append(row)
    heads = ["air / tether"]
    heads += [f"{scheme}, {step:g} s" for scheme in ("explicit", "aitken", "iqn-ils") for step in (0.1, 0.01)]
    return lines(
        table(heads, rows),
        "Deflection after 2 s and evaluations a step of a tether in a gust whose air has inertia, from the change of "
        "velocity over a step (added_mass_coefficient). The explicit scheme multiplies an error by the ratio of masses "
        "in every step, and so is unstable above 1 however short the step (Causin, Gerbeau, Nobile 2005): shorter ones "
        "only make it worse. Within 20 steps of 0.1 s a ratio of 1.1 does not show yet. Implicit coupling cures it at "
        "every ratio.",
    )


def with_added_mass(scheme, ratio, step, end=2.0):
    """Simulation and positions m of the tether where the air that moves with it has `ratio` times its mass."""
    coefficient = ratio * 0.012 / (1.225 * np.pi * 0.004**2 / 4.0)
    return coupled(scheme, step, 1e-7, end, {"added_mass_coefficient": coefficient})


def _draw(path: Path):
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5.0, 3.6), layout="constrained")
    for scheme, marker in zip(SCHEMES, "osx", strict=True):
        found = errors(scheme, STEPS)
        axes.loglog(list(found), [e for e, _ in found.values()], marker + "-", ms=4, label=scheme)
    h = np.array([STEPS[-1], STEPS[0]])
    axes.loglog(h, 0.5 * h, "0.6", lw=0.8, ls="--", label="order 1, 2")
    axes.loglog(h, 0.5 * h**2, "0.6", lw=0.8, ls="--")
    axes.set(xlabel="communication step, s", ylabel="error, m", title="coupled tether in a gust")
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path)
    plt.close(figure)


ENTRIES = (
    Table("particles.coupled", "Coupled in time: order of the coupled solution of a tether in wind", _orders, _draw),
    Table("particles.added_mass", "Coupled in time: inertia of the air, explicit and implicit", _added_mass),
)
