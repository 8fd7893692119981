"""The equations of one implicit step, solved: linearised once, or to a tolerance by Newton's method."""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse.linalg as spla

from structural.statics import NewtonSolve
from structural.stiffness import rounding_of_positions

from .motion import Mass, Motion, State
from .schemes import ImplicitEuler, StepSystem

# Newton iterations of one step: more than one ever needs whose size suits the motion. What takes longer, as a stiff
# line that becomes taut while it turns, is found sooner in two halves.
STEP_ITERATIONS = 20
# Simplified Newton iterations of one step; each must leave less than CONTRACTION of the residual, and if it leaves more
# than QUICK the next has a tangent of its own.
SIMPLIFIED, CONTRACTION, QUICK = 12, 0.5, 0.05


@dataclass(eq=False)
class _Equations:
    """The system of a step in the form that the equilibrium engine solves; it takes the place of an assembly."""

    motion: Motion
    system: StepSystem
    begin: np.ndarray
    scale: float | None = None
    mass: Mass = field(init=False)

    def __post_init__(self):
        a = self.motion.assembly
        self.unknowns, self.diagonal, self.matrix = a.unknowns, a.diagonal, a.matrix
        self.mass = self.motion.mass(self.system.t)

    def moved(self, d, rotations, step):
        return d + step, rotations

    def residual(self, d):
        s = self.system
        elastic, damping, external = self.motion.forces(self.begin + d, s.cw * (d - s.dw), s.t)
        return self._balanced(elastic + damping - external, s.cm * self.mass.times(d - s.da), external)

    def _balanced(self, r, inertia, external):
        if self.scale is None:  # of the first guess: one gone wild must not loosen the tolerance
            self.scale = self.unknowns.norm(external) + self.unknowns.norm(inertia)
        return r + inertia

    def residual_and_tangent(self, d, _prepared=None, _rotations=None):
        s = self.system
        r, data, rates, external = self.motion.evaluated(self.begin + d, s.cw * (d - s.dw), s.t)
        r = self._balanced(r, s.cm * self.mass.times(d - s.da), external)
        if rates is not None:
            data = data + s.cw * rates
        self.mass.add_to(data, self.diagonal, s.cm)
        return r, self.matrix(data), self.scale


class StepSolver:
    """Solves step after step: simplified Newton iterations with the factors of an earlier tangent while these contract,
    whole ones of the equilibrium engine where they do not.
    """

    def __init__(self, motion, scheme, atol, rtol):
        self.motion, self.scheme, self.atol, self.rtol = motion, scheme, atol, rtol
        self._factors = None  # of the tangent, and the system's cm and cw that they belong to
        self._of = None

    def __call__(self, state, h):
        """State after a step of h s, and Newton iterations; None for the state where no solution was found."""
        motion, scheme = self.motion, self.scheme
        if isinstance(scheme, ImplicitEuler) and scheme.linear:
            return linear_step(motion, scheme, state, h), 1
        system = scheme.system(state, h)
        chains = motion.chains(system.t)
        reach = float(np.abs(motion.positions(state.q)).max(initial=0.0))
        atol = max(self.atol, rounding_of_positions(chains, reach))
        equations = _Equations(motion, system, state.q)
        d, count = self._simplified(equations, system, atol)
        flight = float(np.abs(system.start).max(initial=0.0))
        for start in (system.start, np.zeros_like(state.q)) if d is None else ():
            solve = NewtonSolve(equations, None, chains, (start, None), atol, self.rtol, max(1.0, 4.0 * flight))
            solve.run(STEP_ITERATIONS)
            count += len(solve.norms) - 1
            if solve.status == "converged":
                d = solve.at[0]
                break
        return (None if d is None else scheme.advanced(state, h, d)), count

    def _simplified(self, equations, system, atol):
        """Solution (u,) m and iterations; None where they do not contract."""
        d, count = system.start, 0
        r = equations.residual(d)
        norm, fresh = equations.unknowns.norm(r), False
        if self._of != (system.cm, system.cw):
            self._factors = None
        while not norm <= atol + self.rtol * equations.scale:
            if count == SIMPLIFIED or not np.isfinite(norm):
                return None, count
            if self._factors is None:
                r, k, _ = equations.residual_and_tangent(d)
                try:
                    self._factors, self._of, fresh = factorised(k), (system.cm, system.cw), True
                except RuntimeError:  # exactly singular
                    return None, count
            step = self._factors.solve(-r)
            r = equations.residual(d + step)
            after = equations.unknowns.norm(r)
            count += 1
            if after <= CONTRACTION * norm:
                d, norm = d + step, after
            elif fresh:
                return None, count
            else:  # the old tangent will not do
                r = equations.residual(d)
            if not after <= QUICK * norm:
                self._factors = None
        return d, count


def factorised(k):
    """Factors of a tangent, pivots on its diagonal."""
    return spla.splu(k, permc_spec="NATURAL", diag_pivot_thresh=1e-6, options={"SymmetricMode": True})


def linear_step(motion, scheme, state, h):
    """State after (M + h C + h^2 K) dv = -h (R + h K v), forces at the beginning of the step of h s, loads at its end
    (PSM thesis eq. 5.11); None if that is singular.
    """
    r, data, rates, _ = motion.evaluated(state.q, state.v, state.t + h, scheme.isotropic)
    a = motion.assembly
    b = -h * (r + h * (a.matrix(data) @ state.v))
    system = h * h * data
    if rates is not None:
        system = system + h * rates
    motion.mass(state.t + h).add_to(system, a.diagonal, 1.0)
    if scheme.solver == "bicgstab":
        dv, _ = spla.bicgstab(a.matrix(system), b, rtol=1e-5, atol=1e-5, maxiter=100_000)
    else:
        try:
            dv = factorised(a.matrix(system)).solve(b)
        except RuntimeError:  # exactly singular
            return None
    v = state.v + dv
    return State(state.t + h, state.q + h * v, v, dv / h)
