"""Form finding of the self-stressed net (PSM thesis section 6.4, saddle): four ways, one form, and what they cost."""

import time
from dataclasses import dataclass, replace

import numpy as np

from structural import Assembly, Configuration, Loads, tensions
from structural.dynamics import METHODS, Form, form_finding

from .nets import saddle
from .registry import Table
from .text import lines, table

PEER = 8.1  # s, particle system of the LEI thesis, saddle with g = 13 and rest length 0, kinetic damping to 1e-3 N
RATIOS = (0.0, 0.5, 0.9)
# Pseudo-time steps s, with 1 kg a node, springs of 10 N/m and dampers of 1 N s/m.
STEPS = (1.0, 10.0)


@dataclass(frozen=True, eq=False)
class Settled:
    """A form, how long s finding it took, its strain energy J and tensions (e,) N."""

    form: Form
    seconds: float
    energy: float
    tensions: np.ndarray


def settled(g, ratio, method, two_way=True, atol=1e-7, step=1.0, max_steps=1000):
    """The saddle net found in one way; the assembly is made before the clock starts, as the thesis does."""
    s = saddle(g, ratio, two_way)
    chains = tuple(replace(c, c=np.ones_like(c.k)) for c in s.groups)
    assembly, loads = Assembly(s), Loads(np.zeros_like(s.nodes))
    begin = time.perf_counter()
    form = form_finding(assembly, loads, s.nodes, method, atol=atol, step=step, max_steps=max_steps, groups=chains)
    took = time.perf_counter() - begin
    return Settled(form, took, assembly.energy(Configuration(form.x), chains), tensions(form.x, chains[0]))


def _cost(found):
    """Steps and ms, or why not."""
    form = found.form
    return f"{form.iterations}: {1e3 * found.seconds:.1f} ms" if form.converged else form.status.replace("_", " ")


def _nets(quick):
    rows = []
    for g in (5,) if quick else (5, 13):
        for ratio in RATIOS:
            for two_way in (True, False) if ratio else (True,):
                exact = settled(g, ratio, "equilibrium", two_way, atol=1e-10)
                for method in METHODS:
                    for step in STEPS if method != "equilibrium" else (1.0,):
                        tight = settled(g, ratio, method, two_way, 1e-7, step)
                        loose = settled(g, ratio, method, two_way, 1e-3, step)
                        off = np.abs(tight.form.x - exact.form.x).max()
                        pull = np.abs(tight.tensions - exact.tensions).max()
                        pseudo = "" if method == "equilibrium" else f"{step:g}"
                        kind = "springs" if two_way else "lines"
                        differences = (f"{off:.1e}", f"{pull:.1e}", f"{tight.energy - exact.energy:+.1e}")
                        rows.append([g, ratio, kind, method, pseudo, _cost(loose), _cost(tight), *differences])
    heads = ["g", "ratio", "elements", "way", "step s", "to 1e-3 N", "to 1e-7 N", "form off, m", "tension off, N",
             "energy off, J"]  # fmt: skip
    default = settled(13, 0.0, "kinetic", atol=1e-3).seconds
    return lines(
        table(heads, rows),
        "Steps or Newton iterations, and ms, to an out-of-balance force; form, tensions and strain energy at 1e-7 N "
        "against those of the equilibrium engine at 1e-10 N. g² + (g - 1)² nodes, springs of 10 N/m, rest lengths a "
        "`ratio` of the initial ones, 1 kg a node, at most 1000 steps.",
        f"Saddle with g = 13, ratio 0, kinetic damping to 1e-3 N, mass 1 kg and step 1 s, the defaults: "
        f"{1e3 * default:.0f} ms, {PEER / default:.0f} times faster than the {PEER} s of the peer.",
        "With ratios 0 and 0.5, and 0.9 on the coarse net, all ways that converge find one form. At 0.9 and g = 13 "
        "parts of the net are shorter than their rest lengths. Where springs may push, it then has several stable "
        "equilibria, and that of least energy is not the one that the equilibrium engine finds; where they may not, "
        "slack ones leave nodes free: energy and tensions are the same, the form is not determined. The correction of "
        "kinetic damping (kinetic-q) may go round in a cycle with implicit steps of 1 s; longer ones, nearer to "
        "Newton's method, mostly end it.",
    )


ENTRIES = (Table("particles.nets", "The self-stressed net: one form found in four ways, and their cost", _nets),)
