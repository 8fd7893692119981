"""The equations of one implicit step, solved: linearised once, or to a tolerance by Newton's method."""

import numpy as np
import scipy.sparse.linalg as spla

from structural.elements import Configuration
from structural.solve import Singular
from structural.solve.linear import factorised
from structural.solve.newton import Newton, rounding_of_positions, stiffest

from .motion import Mass, Motion, State
from .schemes import ImplicitEuler, StepSystem

# Newton iterations of one step: more than one ever needs whose size suits the motion. What takes longer, as a stiff
# line that becomes taut while it turns, is found sooner in two halves.
STEP_ITERATIONS = 20
# Modified Newton iterations of one step; each must leave less than CONTRACTION of the residual, and if it leaves more
# than REUSE the next has a tangent of its own.
MODIFIED, CONTRACTION, REUSE = 12, 0.5, 0.05


class StepProblem:
    """The system of a step for Newton's method; the unknowns are the displacement d (u,) m since its beginning."""

    def __init__(self, motion: Motion, system: StepSystem, begin: np.ndarray, at: Configuration):
        self._motion, self._system, self._begin = motion, system, begin
        a = motion.assembly
        self.rotational, self.diagonal = a.unknowns.rotational, a.diagonal
        self.norm, self._matrix = a.unknowns.norm, a.matrix
        self.stiffest = stiffest(motion.groups(system.t), at)
        self._mass: Mass = motion.mass(system.t)
        self.scale: float | None = None  # norm N of forces and inertia of the first guess

    def residual(self, d):
        """Residual (u,) N alone."""
        s = self._system
        elastic, damping, external = self._motion.forces(self._begin + d, s.cw * (d - s.dw), s.t)
        return self._balanced(elastic + damping - external, d, self.norm(external))

    def residual_and_tangent(self, d):
        """See Problem; the norm is that of the first guess: one gone wild must not loosen the tolerance."""
        s = self._system
        r, data, rates, external = self._motion.evaluated(self._begin + d, s.cw * (d - s.dw), s.t)
        r = self._balanced(r, d, external)
        if rates is not None:
            data = data + s.cw * rates
        self._mass.add_to(data, self.diagonal, s.cm)
        return r, self._matrix(data), self.scale

    def moved(self, d, step):
        """See Problem."""
        return d + step

    def rounding(self, d):
        """See Problem: what rounding leaves is in the tolerance of a step already."""
        return 0.0

    def _balanced(self, r, d, external):
        s = self._system
        inertia = s.cm * self._mass.times(d - s.da)
        if self.scale is None:
            self.scale = external + self.norm(inertia)
        return r + inertia


class StepSolver:
    """Solves step after step: modified Newton iterations with the factors of an earlier tangent while these
    contract, those of the equilibrium engine where they do not.
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
        at = Configuration(motion.positions(state.q))
        reach = float(np.abs(at.x).max(initial=0.0))
        atol = max(self.atol, rounding_of_positions(motion.groups(system.t), at, reach))
        problem = StepProblem(motion, system, state.q, at)
        d, count = self._modified_newton(problem, system, atol)
        predicted = float(np.abs(system.start).max(initial=0.0))
        for start in (system.start, np.zeros_like(state.q)) if d is None else ():
            solve = Newton(problem, start, atol, self.rtol, max(1.0, 4.0 * predicted))
            solve.run(STEP_ITERATIONS)
            count += solve.iterations
            if solve.status == "converged":
                d = solve.at
                break
        return (None if d is None else scheme.advanced(state, h, d)), count

    def _modified_newton(self, problem, system, atol):
        """Solution (u,) m and iterations; None where they do not contract."""
        d, count = system.start, 0
        r = problem.residual(d)
        norm, fresh = problem.norm(r), False
        if self._of != (system.cm, system.cw):
            self._factors = None
        while not norm <= atol + self.rtol * problem.scale:
            if count == MODIFIED or not np.isfinite(norm):
                return None, count
            if self._factors is None:
                r, k, _ = problem.residual_and_tangent(d)
                try:
                    self._factors, self._of, fresh = factorised(k), (system.cm, system.cw), True
                except Singular:
                    return None, count
            step = self._factors.solve(-r)
            r = problem.residual(d + step)
            after = problem.norm(r)
            count += 1
            if after <= CONTRACTION * norm:
                d, norm = d + step, after
            elif fresh:
                return None, count
            else:  # the old tangent will not do
                r = problem.residual(d)
            if not after <= REUSE * norm:
                self._factors = None
        return d, count


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
        except Singular:
            return None
    v = state.v + dv
    return State(state.t + h, state.q + h * v, v, dv / h)
