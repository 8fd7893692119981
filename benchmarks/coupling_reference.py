"""Acceleration schemes on the reference problems, side by side with Kratos CoSimulation and preCICE, as a table."""

import itertools
import math

from master.coupling.acceleration import IQNILS, IQNIMVJ, Aitken

from . import kratos
from .reference_problems import REFERENCES, March, Reference
from .registry import Table
from .text import lines, table

# Title and factory of each scheme of ours: a fresh object with default settings for every problem.
OURS = (("IQN-ILS", IQNILS), ("IQN-IMVJ", IQNIMVJ), ("Aitken", Aitken))

# Settings tried of each accelerator of Kratos. Its defaults are 20, 1 and 0.125 for iqnils, 15 and 0.125 for mvqn.
SETTINGS = {
    "iqnils": {"iteration_horizon": (10, 12, 20), "timestep_horizon": (3, 6, 10, 15), "alpha": (0.125, 1.0)},
    "mvqn": {"horizon": (10, 12, 20), "alpha": (0.125, 0.5, 1.0)},
}
# Alike for all: a scheme may take 200 evaluations of G, and only values that are not finite end a step earlier.
LIMITS = {"max_iterations": 200, "stall_window": 0, "growth_limit": math.inf}


def candidates(kind, fields, quick=False):
    """Accelerators of Kratos with every combination of `SETTINGS`; with several fields also one of each field."""
    grid = itertools.product(*SETTINGS[kind].values())
    for values in list(grid)[-1:] if quick else grid:
        for separately in (False, True) if fields else (False,):
            yield kratos.KratosAccelerator(kind, separately, **dict(zip(SETTINGS[kind], values, strict=True)))


def best_of_kratos(kind, reference: Reference, steps=None, quick=False):
    """The march with the fewest evaluations of G a step, else that which failed last, and its accelerator."""
    tried: list[tuple[March, kratos.KratosAccelerator]] = [
        (reference.march(scheme, steps, **LIMITS), scheme) for scheme in candidates(kind, reference.fields, quick)
    ]
    return min(tried, key=lambda pair: (-pair[0].failed if pair[0].failed else -math.inf, pair[0].mean))


def cell(march):
    """Mean evaluations of G a step, or the step that failed."""
    return f"fails at step {march.failed}" if march.failed else f"{march.mean:.2f}".removesuffix(".00")


def reference(quick):
    """Mean evaluations of G a step of every scheme on every problem, and the best settings of Kratos."""
    installed = kratos.version()
    steps = 3 if quick else None
    rows, settings = [], []
    for problem in REFERENCES:
        row = [problem.name, str(problem.steps)]
        row += [cell(problem.march(scheme(), steps, **LIMITS)) for _, scheme in OURS]
        found = [best_of_kratos(kind, problem, steps, quick) if installed else None for kind in SETTINGS]
        row += [cell(best[0]) if best else "not installed" for best in found]
        row += ["" if figure is None else f"{figure:g}" for figure in (problem.precice, problem.bound)]
        rows.append(row)
        settings.append([problem.name, *("fails" if b[0].failed else str(b[1]) for b in found if b)])
    ours = [title for title, _ in OURS]
    head = ["problem", "steps", *ours, *(f"Kratos {kind}" for kind in SETTINGS), "preCICE", "bound"]
    shown = table(head, rows)
    told = (
        "Mean evaluations of G a step. Ours: one default setting for all problems. preCICE 3.4.1: published figures "
        "of its default, QR3 filter 1e-2, residual-sum scaling, reuse of ten steps. The bound is that of IQN-ILS."
    )
    if not installed:
        return lines(shown, told, f"{kratos.NOT_INSTALLED}; `pip install -c constraints.txt -e '.[peers]'` brings it.")
    tried = "; ".join(
        f"{kind}: " + ", ".join(f"{name} {' or '.join(f'{v:g}' for v in values)}" for name, values in options.items())
        for kind, options in SETTINGS.items()
    )
    peers = (
        f"Kratos {installed} runs in the same process under the same convergence test, with the settings that are best "
        f"for each problem of those tried ({tried}; where there are fields, one accelerator for all or one for each). "
        "Its block accelerators relax after each solver and have a test of their own; they are left out."
    )
    best = table(["problem", *(f"best {kind}" for kind in SETTINGS)], settings)
    return lines(shown, told, peers, "\n".join(best))


ENTRIES = (
    Table(
        name="coupling.reference",
        title="Acceleration schemes on the reference problems",
        build=reference,
    ),
)
