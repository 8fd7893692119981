"""Run time over size: a hanging tether beside scipy's solvers (PSM thesis figure 8.1), and the net (figure 8.3)."""

import contextlib
import functools
from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

from structural import Assembly, Loads
from structural.dynamics import METHODS, GeneralisedAlpha, ImplicitEuler, form_finding, integrate

from .nets import saddle
from .particle_validation import dropped, hanging_still, moving
from .registry import Case, Curve, Fit, Outcome

DURATION, PUSH = 1.0, -0.1  # s, m/s
SCHEMES = {
    "linear implicit Euler, 1 ms": (ImplicitEuler(linear=True), 1e-3),
    "generalised-alpha 0.5, 1 ms": (GeneralisedAlpha(0.5), 1e-3),
    "generalised-alpha 0.5, 5 ms": (GeneralisedAlpha(0.5), 5e-3),
}
BLACK_BOXES = {"solve_ivp RK45": "RK45", "solve_ivp LSODA": "LSODA", "solve_ivp BDF": "BDF"}


@functools.cache
def tether(n):
    """Validation 1 with n particles at rest, its block just pushed down: equations of motion, and the state."""
    s = dropped(n)
    x = np.column_stack([s.x[:, :2], hanging_still(n)])
    v = np.zeros_like(x)
    v[-1, 2] = PUSH
    motion = moving(s)
    return motion, motion.at(x, v)


@functools.cache
def block(n):
    """Position m of the block after DURATION, by generalised-alpha with steps of 0.1 ms."""
    motion, start = tether(n)
    return motion.positions(integrate(motion, start, DURATION, GeneralisedAlpha(0.5), 1e-4).state.q)[-1]


@contextlib.contextmanager
def pushed(series, n):
    """One second of motion; the answer is where the block is then."""
    motion, start = tether(n)

    def by_steps():
        end = integrate(motion, start, DURATION, *SCHEMES[series])
        found = motion.positions(end.state.q)[-1]
        return Outcome(found, {"evaluations": end.newton_iterations}, "converged" if end.finished else end.status)

    def by_scipy():
        u = motion.unknowns.count

        def rates(t, y):
            return np.concatenate([y[u:], motion.acceleration(y[:u], y[u:], t)])

        begin = np.concatenate([start.q, start.v])
        end = solve_ivp(rates, (0.0, DURATION), begin, BLACK_BOXES[series], rtol=1e-5, atol=1e-7)
        found = motion.positions(end.y[:u, -1])[-1]
        return Outcome(found, {"evaluations": end.nfev}, "converged" if end.success else "failed")

    yield by_steps if series in SCHEMES else by_scipy


@contextlib.contextmanager
def self_stressed(series, g):
    """b4: the saddle net of 6e4 N/m, 1 N s/m, 1 kg a particle; the answer is the out-of-balance force."""
    s = saddle(g, 0.5, True)
    chains = tuple(replace(c, k=np.full_like(c.k, 6e4), c=np.ones_like(c.k)) for c in s.groups)
    assembly, loads = Assembly(s), Loads(np.zeros_like(s.nodes))

    def work():
        form = form_finding(assembly, loads, s.nodes, series, groups=chains)
        return Outcome(form.residuals[-1], {"dof": 3 * len(s.nodes), "steps": form.iterations}, form.status)

    yield work


ENTRIES = (
    Case(
        name="particles.scaling.tether",
        title="A hanging tether after a push: time over particles, beside scipy's solvers",
        knob="particles",
        values=(5, 10, 20),
        quick=(5,),
        error="distance of the block",
        unit="m",
        reference="generalised-alpha, steps of 0.1 ms",
        prepare=pushed,
        truth=lambda series, n: block(n),
        bound=5e-4,
        series=(*SCHEMES, *BLACK_BOXES),
        repeats=1,
        memory=False,
        plot=Curve("value", "time_s"),
        fit=Fit("value", "time_s", "time ~ particles"),
        labels={"evaluations": "evaluations or Newton iterations"},
        note="PSM thesis figure 8.1, for one second of motion: its tether is undamped but for 92 N s/m a spring and "
        "would take minutes of it to come to rest. 5.14 m of Dyneema under 327.8 kg, hanging still, then pushed by "
        "0.1 m/s. solve_ivp with rtol 1e-5 and atol 1e-7 has the same forces and no derivatives of them. Waves along "
        "the tether run at 1.4e3 (n - 1) rad/s and more, which explicit steps must resolve.",
    ),
    Case(
        name="particles.scaling.net",
        title="The self-stressed net of 6e4 N/m: time of form finding over degrees of freedom",
        knob="g",
        values=(3, 5, 7, 10, 13, 16, 19, 23, 31),
        quick=(3, 5, 7),
        error="out-of-balance force",
        unit="N",
        reference="equilibrium: no force is out of balance",
        prepare=self_stressed,
        truth=lambda series, g: 0.0,
        bound=1e-3,
        series=METHODS,
        repeats=3,
        memory=False,
        plot=Curve("dof", "time_s"),
        fit=Fit("dof", "time_s", "time ~ dof", least=200.0),
        labels={"dof": "degrees of freedom", "steps": "steps"},
        note="PSM thesis figure 8.3 (b4, k = 6e4 N/m, c = 1 N s/m, m = 1 kg, h = 1 s, to 1e-3 N), three degrees of "
        "freedom a particle as it counts them, from 39 to 5583; the assembly is made before.",
    ),
)
