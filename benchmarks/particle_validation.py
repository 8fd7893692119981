"""Validation cases 1 to 3 of the PSM thesis against closed forms and an independent boundary-value problem."""

from pathlib import Path

import numpy as np

from structural.dynamics import BDF2, GeneralisedAlpha, ImplicitEuler, form_finding, integrate

from .particle_models import (
    DIAMETER,
    LENGTH,
    MODULUS,
    G,
    elastic_catenary,
    row,
    straight,
    tether_in_wind,
    wind,
)
from .registry import Table
from .text import lines, table

# Validation 1 (table A.1): 5.14 m of Dyneema, 5 particles, the weight of 327.8 kg on the last one.
TETHER, K_S, DAMPING, BLOCK, DENSITY = 5.14, 119575.9, 92.0, 327.8, 0.012
# Validation 2: 10 m, 0.1 kg/m, k_S = 2e3 N/m; the span is not given.
CABLE, SPAN, CABLE_WEIGHT, CABLE_EA = 10.0, 8.0, 0.1 * G, 2e4


def dropped(n=5, c=DAMPING):
    """Validation 1: the tether hangs along -z from the first particle, undeformed."""
    x = -straight(n, TETHER, 2)
    mass = np.full(n, DENSITY * TETHER / (n - 1))
    mass[[0, -1]] *= 0.5
    mass[-1] += BLOCK
    dead = np.outer(mass, [0.0, 0.0, -G])
    return row(x, K_S * (n - 1), TETHER / (n - 1), c, two_way=False, dead=dead, mass=mass, free_end=True)


def hanging_still(n=5):
    """z m (n,) of its particles at rest: every spring carries what hangs below it."""
    s = dropped(n)
    below = G * np.cumsum(s.mass[::-1])[::-1][1:]
    return -np.concatenate([[0.0], np.cumsum(TETHER / (n - 1) + below / (K_S * (n - 1)))])


def first_frequency(scheme, step, duration=5.0):
    """Hz of the block's oscillation after a push of 0.1 m/s, without dampers, from the first zero crossing to the last.

    It moves by 5 mm then, less than the 27 mm that its weight stretches the tether, which stays taut.
    """
    s = dropped(c=0.0)
    motion = moving(s)
    x = np.column_stack([s.x[:, :2], hanging_still()])
    v = np.zeros_like(x)
    v[-1, 2] = -0.1
    seen = []
    integrate(motion, motion.at(x, v), duration, scheme, step, callback=lambda a: seen.append((a.t, a.q, a.v)))
    z = np.array([motion.positions(q)[-1, 2] for _, q, _ in seen]) - x[-1, 2]
    t = np.array([a[0] for a in seen])
    at = np.flatnonzero(z[:-1] * z[1:] < 0.0)
    crossings = t[at] - z[at] * (t[at + 1] - t[at]) / (z[at + 1] - z[at])
    return 0.5 * (len(crossings) - 1) / (crossings[-1] - crossings[0])


def moving(s):
    """The equations of motion of a system."""
    from structural.dynamics import Motion

    return Motion(s.assembly, s.mass, s.loads, s.groups)


def settled(step=0.1, steps=1000):
    """z m (n,) of validation 1 as the thesis finds it: 1000 steps of 0.1 s of linearly implicit Euler."""
    s = dropped()
    motion = moving(s)
    end = integrate(motion, motion.at(s.x), step * steps, ImplicitEuler(linear=True), step)
    return motion.positions(end.state.q)[:, 2]


def catenary(n, stiffness=CABLE_EA):
    """Largest distance m of n particles in validation 2 to the elastic catenary with EA = `stiffness` N."""
    mass = np.full(n, CABLE_WEIGHT * CABLE / (n - 1) / G)
    mass[[0, -1]] *= 0.5
    k, l0 = stiffness / CABLE * (n - 1), CABLE / (n - 1)
    s = row(straight(n, SPAN), k, l0, two_way=False, dead=np.outer(mass, [0.0, 0.0, -G]))
    form = form_finding(s.assembly, s.loads, s.x, atol=1e-7, groups=s.groups)
    exact = elastic_catenary(CABLE, SPAN, CABLE_WEIGHT, stiffness, np.linspace(0.0, CABLE, n))
    return float(np.linalg.norm(form.x[:, [0, 2]] - exact, axis=1).max()), form


def deflection(n=25, factor=1.0, law="inclined"):
    """Deflection m of validation 3 with n particles."""
    k = MODULUS * 0.25 * np.pi * DIAMETER**2 / LENGTH * (n - 1)
    s = row(straight(n, LENGTH, 2), k, LENGTH / (n - 1), two_way=False, wind=wind(factor, law))
    form = form_finding(s.assembly, s.loads, s.x, atol=1e-6, groups=s.groups)
    return float(form.x[:, 0].max()), form


def _first(_quick):
    exact = np.sqrt(K_S / BLOCK) / (2.0 * np.pi)
    rows = [
        [name, step, f"{(found := first_frequency(scheme, step)):.5f}", f"{100.0 * (found / exact - 1.0):+.3f} %"]
        for name, scheme in (
            ("implicit Euler", ImplicitEuler()),
            ("generalised-alpha, 0.5", GeneralisedAlpha(0.5)),
            ("BDF2", BDF2()),
        )
        for step in (1e-2, 1e-3)
    ]
    still = hanging_still()
    s = dropped()
    form = form_finding(s.assembly, s.loads, s.x, atol=1e-6, groups=s.groups)
    return lines(
        table(["scheme", "step s", "first frequency Hz", "off"], rows),
        f"Closed form sqrt(k_S / m) / 2 pi = {exact:.5f} Hz (massless tether; its own mass takes 0.003 %); thesis "
        "3.00006 Hz with steps of 1e-4 s, experiment 3.0041 to 3.0518 Hz.",
        f"Steady positions: equilibrium engine within {np.abs(form.x[:, 2] - still).max():.1e} m of the closed form, "
        f"1000 implicit steps of 0.1 s within {np.abs(settled() - still).max():.1e} m (thesis 1.9e-6 m).",
    )


def _second(quick):
    sizes = (5, 9, 17) if quick else (5, 9, 17, 33, 65)
    elastic, stiff = ([catenary(n, ea)[0] for n in sizes] for ea in (CABLE_EA, 1e8))
    rows = []
    for i, n in enumerate(sizes):
        orders = ["" if i == 0 else f"{np.log2(e[i - 1] / e[i]):.2f}" for e in (elastic, stiff)]
        rows.append([n, f"{1e3 * elastic[i]:.3f}", orders[0], f"{1e3 * stiff[i]:.3f}", orders[1]])
    heads = ["particles", "EA = 20 kN: off, mm", "order", "EA = 100 MN: off, mm", "order"]
    return lines(
        table(heads, rows),
        f"{CABLE:g} m over a span of {SPAN:g} m (our choice; the thesis gives none), largest distance to the elastic "
        "catenary; with EA = 100 MN it is the inextensible one to 1e-8 of its length.",
    )


def _third(quick):
    exact = {(f, law): tether_in_wind(f, law) for f in (1.0, 2.0, 4.0) for law in ("inclined", "projected")}
    rows = [
        [n, deflection(n)[0], f"{100 * (deflection(n)[0] / exact[1.0, 'inclined'] - 1):+.3f} %"]
        for n in (7, 13, 25, 49)
    ]
    factors = [[f"{f:g} x drag", exact[f, "inclined"], exact[f, "projected"]] for f in (1.0, 2.0, 4.0)]
    return lines(
        table(["particles", "deflection m", "off the boundary-value problem"], rows),
        "\n".join(table(["continuous cable", "inclined cylinder, m", "area d l (1 - |cos|), m"], factors)),
        "Neither 5.8 m (thesis) nor 4.5 m (Baayen) is what drag 1/2 rho C_D d l U^2 with C_D = 1.22, d = 4 mm, 6 m/s "
        "makes of a tether of 2933 N/m: that is 3.6 m. Twice the drag gives 4.5 m and four times the drag 5.7 m: the "
        "factor 2 of a drag without its one half would explain Baayen's figure, and both that and a drag that is given "
        "whole to each end of a segment, not half, the thesis'. Which law of the inclined line is taken matters by "
        "0.4 %.",
    )  # fmt: skip


def _draw(path: Path):
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    for n in (5, 20):
        _, form = catenary(n)
        axes[0].plot(form.x[:, 0], form.x[:, 2], "o-", ms=3, lw=0.8, label=f"{n} particles")
    exact = elastic_catenary(CABLE, SPAN, CABLE_WEIGHT, CABLE_EA, np.linspace(0.0, CABLE, 200))
    axes[0].plot(*exact.T, "k", lw=0.8, label="elastic catenary")
    axes[0].set(xlabel="x, m", ylabel="z, m", title="validation 2: hanging", aspect="equal")
    for factor in (1.0, 2.0, 4.0):
        _, form = deflection(25, factor)
        axes[1].plot(form.x[:, 2], form.x[:, 0], "o-", ms=3, lw=0.8, label=f"{factor:g} x drag")
    for value, name in ((5.8, "thesis"), (4.5, "Baayen")):
        axes[1].axhline(value, color="0.5", lw=0.8, ls=":")
        axes[1].text(2.0, value, name, va="bottom", fontsize=8)
    axes[1].set(xlabel="z, m", ylabel="deflection, m", title="validation 3: across the wind", ylim=(-0.3, 6.6))
    for a in axes:
        a.legend(frameon=False, fontsize=8)
    figure.savefig(path)
    plt.close(figure)


ENTRIES = (
    Table("particles.dropped", "Validation 1 of the PSM thesis: frequency and rest of a loaded tether", _first),
    Table("particles.catenary", "Validation 2: the catenary, order of convergence in the particles", _second),
    Table(
        "particles.wind",
        "Validation 3: a tether across the wind, and what explains the published figures",
        _third,
        _draw,
    ),
)
