"""Form finding: the shape at rest, by the equilibrium engine or by dynamic relaxation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from structural.assembly import Assembly
from structural.elements import Configuration, ElementGroup
from structural.elements.chains import Chains
from structural.model import Loads
from structural.solve import Singular
from structural.solve.linear import factorised
from structural.solve.newton import rounding_of_positions
from structural.solve.statics import equilibrium

from .motion import Motion, State
from .schemes import ImplicitEuler
from .steps import linear_step

Method = Literal["equilibrium", "viscous", "kinetic", "kinetic-q"]
METHODS = ("equilibrium", "viscous", "kinetic", "kinetic-q")
# A particle system whose out-of-balance force has grown by this much since the beginning diverges.
DIVERGED = 1e12
# A start out of balance by less than this part of the load (without any, of what the start by force densities is out of
# balance by) is kept. Newton iterations with members that push.
NEAR, PUSHING = 1e-2, 50
# Bounds of the common pull N relative to the load and to the stiffest element, within which it is sought.
MIN_PULL, MAX_PULL = 1e-6, 1.0


@dataclass(frozen=True, eq=False)
class Form:
    """A form that was found: node positions `x` (n,3) m, "converged" or why not ("max_iterations", "diverged", or what
    the equilibrium engine says), Newton iterations or time steps, the out-of-balance force N after each of them, and
    how often kinetic damping stopped all particles.
    """

    x: np.ndarray
    status: str
    iterations: int
    residuals: tuple[float, ...]
    resets: int = 0

    @property
    def converged(self) -> bool:
        """Whether the out-of-balance force met the tolerance."""
        return self.status == "converged"


def form_finding(
    assembly: Assembly,
    loads: Loads,
    x0: np.ndarray,
    method: Method = "equilibrium",
    atol: float = 1e-3,
    mass: float | np.ndarray = 1.0,
    step: float = 1.0,
    max_steps: int = 1000,
    scheme: ImplicitEuler | None = None,
    groups: Sequence[ElementGroup] | None = None,
) -> Form:
    """The equilibrium under `loads` near the node positions x0 (n,3) m, to `atol` N out of balance, or to what rounding
    of the coordinates leaves. `groups` replace the elements of the structure.

    "equilibrium" is Newton's method on the static residual, and needs nothing else. The others are dynamic relaxation:
    particles of `mass` kg (one, or (n,)) go through pseudo-time with linearly implicit Euler steps of `step` s,
    `max_steps` at most: "viscous" with the damping of the elements; "kinetic" without, and brings all particles to rest
    whenever the kinetic energy has fallen (Barnes; PSM thesis section 4.4); "kinetic-q" also puts them back to where a
    parabola through the last three energies has its peak (eq. 4.10). Mass, step and damping are means: the form does
    not depend on them.

    ValueError in one sentence for an unknown method, or values that cannot be.
    """
    if method not in METHODS:
        raise ValueError(f"there is no method '{method}' of form finding; choose one of: {', '.join(METHODS)}.")
    for name, value in (("tolerance", atol), ("time step", step)):
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"the {name} must be a number above zero; it is {value:g}.")
    groups = tuple(assembly.structure.groups if groups is None else groups)
    at = Configuration(x0, assembly.start())
    atol = max(atol, rounding_of_positions(groups, at, float(np.abs(x0).max(initial=0.0))))
    if method == "equilibrium":
        return _balanced(assembly, groups, loads, x0, atol)
    if method != "viscous":
        groups = tuple(group.undamped() for group in groups)
    masses = np.broadcast_to(np.asarray(mass, float), len(x0))
    scheme = scheme or ImplicitEuler(linear=True)
    relaxation = _DynamicRelaxation(Motion(assembly, masses, loads, groups), scheme, x0, step, atol)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return relaxation.run(method, max_steps)


def _balanced(assembly, groups, loads, x0, atol):
    """The equilibrium, sought from x0 if that is nearly one, else from the net of equal force densities.

    From there elements may push at first: that evens out their lengths in a few Newton iterations where slack ones
    would have no stiffness. If all are taut then it is the answer already.
    """
    prepared = assembly.prepare(loads, groups)

    def imbalance(x):
        r, load = assembly.residual(assembly.unknowns.restrict(x), prepared)
        return assembly.unknowns.norm(r), load

    residuals: tuple[float, ...] = ()
    iterations = 0
    pulled = force_density_start(assembly, groups, loads, x0)
    out, load = imbalance(x0)
    if pulled is not None and not out < NEAR * (load or imbalance(pulled)[0]):
        x0 = pulled
        pushing = tuple(group.never_slack() for group in groups)
        if any(a is not b for a, b in zip(pushing, groups, strict=True)):
            first = equilibrium(assembly, loads, x0, atol, groups=pushing, max_iterations=PUSHING, step_limit=np.inf)
            if first.converged:
                x0, residuals, iterations = first.x, first.residuals, first.iterations
    found = equilibrium(assembly, loads, x0, atol, groups=groups, step_limit=np.inf)
    if not found.converged:  # members that snap from slack to taut need shorter steps than the loads would make
        limited = equilibrium(assembly, loads, x0, atol, groups=groups)
        found = limited if limited.converged else found
    return Form(found.x, found.status, iterations + found.iterations, residuals + found.residuals)


def force_density_start(assembly: Assembly, groups: Sequence[ElementGroup], loads: Loads, x0: np.ndarray):
    """Node positions (n,3) m where every element pulls with s l / l0 and the loads are those at x0; None where there
    are no springs or lines, some run through more than two nodes or have no length, or nothing holds them.

    With given force densities equilibrium is linear (Schek 1974): x = x_held + x_loaded / s with two solutions on one
    factorisation. The pull s is that for which the elements together have the length that they have under it.
    """
    chains = [g for g in groups if isinstance(g, Chains)]
    if not chains or any(c.nodes.shape[1] != 2 or np.any(c.l0 <= 0.0) for c in chains):
        return None

    def pulling(c):
        return replace(c.never_slack(), l0=np.zeros_like(c.l0), k=1.0 / c.l0)

    nets = tuple(pulling(g) if isinstance(g, Chains) else g for g in groups)
    q0 = assembly.unknowns.restrict(x0)
    held, k, _ = assembly.residual_and_tangent(q0, assembly.prepare(Loads(np.zeros_like(loads.dead)), nets))
    loaded, _ = assembly.residual(q0, assembly.prepare(loads, nets))
    try:
        factors = factorised(k)
    except Singular:  # nothing holds a part of it
        return None
    at_rest, moved = q0 - factors.solve(held), factors.solve(held - loaded)
    load = assembly.unknowns.norm(held - loaded)
    if not load > 0.0:
        return assembly.positions(at_rest)

    def too_long(log_pull):
        pull = np.exp(log_pull)
        x = assembly.positions(at_rest + moved / pull)
        gap = 0.0
        for c in chains:
            length = np.linalg.norm(x[c.nodes[:, 1]] - x[c.nodes[:, 0]], axis=1)
            gap += float(np.sum(length - c.l0 - pull * length / (c.l0 * c.k)))
        return gap

    low = np.log(MIN_PULL * load)
    high = np.log(max(max(float(np.max(c.k * c.l0)) for c in chains) * MAX_PULL, 10.0 * MIN_PULL * load) * 1e3)
    if not too_long(low) > 0.0 > too_long(high):
        return None
    from scipy.optimize import brentq  # not loaded where no form is found

    return assembly.positions(at_rest + moved / np.exp(brentq(too_long, low, high, xtol=1e-3)))


class _DynamicRelaxation:
    """Particles on their way to rest, with viscous or kinetic damping."""

    def __init__(self, motion, scheme, x0, step, atol):
        self.motion, self.scheme, self.h, self.atol = motion, scheme, step, atol
        q = motion.unknowns.restrict(np.asarray(x0, float))
        self.state = State(0.0, q, np.zeros_like(q), np.zeros_like(q))
        self.residuals = [self._residual(q)]
        self.resets = 0

    def _residual(self, q):
        r, _ = self.motion.assembly.residual(q, self.motion.prepared(0.0))
        return self.motion.unknowns.norm(r)

    def run(self, method, max_steps):
        """Steps until the residual meets the tolerance."""
        status, energies, places = "max_iterations", [0.0, 0.0], [self.state.q, self.state.q]
        steps = 0
        while True:
            if self.residuals[-1] <= self.atol:
                status = "converged"
                break
            if not self.residuals[-1] <= DIVERGED * max(self.residuals[0], self.atol):
                status = "diverged"
                break
            if steps == max_steps:
                break
            new = linear_step(self.motion, self.scheme, self.state, self.h)
            if new is None:
                status = "diverged"
                break
            steps += 1
            if method != "viscous":
                energy = self.motion.kinetic_energy(new)
                if energy < energies[-1]:
                    q = _peak(energies, energy, places, new.q) if method == "kinetic-q" else new.q
                    new = State(new.t, q, np.zeros_like(q), np.zeros_like(q))
                    energies, places, energy = [0.0, 0.0], [q, q], 0.0
                    self.resets += 1
                energies, places = [energies[-1], energy], [places[-1], new.q]
            self.state = replace(new, t=0.0)
            self.residuals.append(self._residual(new.q))
        x = self.motion.positions(self.state.q)
        return Form(x, status, steps, tuple(self.residuals), self.resets)


def _peak(energies, energy, places, q):
    """Positions (u,) m at the peak of the kinetic energy, between the last three steps (PSM thesis eq. 4.10, 4.11)."""
    bend = 2.0 * energies[1] - energies[0] - energy
    part = (energies[1] - energy) / bend if bend > 0.0 else 0.5
    if part < 0.5:
        return places[0] + 2.0 * part * (places[1] - places[0])
    return places[1] + (2.0 * min(part, 1.0) - 1.0) * (q - places[1])
