"""Static equilibrium: Newton on the true residual, globalised so that slack members and mechanisms do no harm."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg as spla

from .assembly import Assembly
from .chains import Chains
from .structure import Loads

# The shift that is always there, relative to the mean stiffness: it gives directions without any stiffness (slack
# nodes without weight) a zero step instead of an infinite one, and leaves Newton's convergence untouched.
SMALLEST_SHIFT = 1e-12
# Least stiffness of the shift, relative to that of the stiffest element, where all members are slack.
SOFTEST = 1e-6
# Steps refused one after the other, and trials along one step, before giving up.
MOST_REJECTIONS, MOST_TRIALS = 12, 12
# After this many short steps in a row (below a third) whole Newton steps are tried again, at most BURST of them.
SHORT_STEPS, BURST = 3, 5
# Work left at the end of a line search, relative to that at its start. A trial costs a tenth of a factorisation, so
# that a search nearly to the end pays where members buckle.
LINE_SEARCH = 0.1
# First shift where one is needed, relative to the mean stiffness, and the one from which it counts as none.
FIRST_SHIFT, NO_SHIFT = 1e-4, 1e-8


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Result of a static solve: `x` (n,3) m, `status` "converged" or why not, the residual norms N met on the way, and
    in how many directions the converged equilibrium is unstable under its loads (0: it is stable).
    """

    x: np.ndarray
    status: str
    iterations: int
    residuals: tuple[float, ...]
    unstable_modes: int = 0

    @property
    def converged(self):
        """Whether the residual met the tolerance."""
        return self.status == "converged"

    @property
    def residual(self):
        """Norm of the out-of-balance force over the free dofs, N."""
        return self.residuals[-1]


def equilibrium(
    assembly: Assembly,
    chains: tuple[Chains, ...],
    loads: Loads,
    x0: np.ndarray,
    atol: float = 1e-6,
    rtol: float = 0.0,
    max_iterations: int = 200,
    step_limit: float = 1.0,
) -> Equilibrium:
    """Positions where internal and external forces balance: ||r|| <= atol + rtol ||f_ext||, in newtons.

    Where the elements are so stiff that rounding of their lengths alone makes larger forces, that rounding is the
    tolerance.

    Whole Newton steps come first and are kept as long as each burst of them lowers the residual: that is all a warm
    start needs, and it is what stiff members need that turn by a large angle. Otherwise Newton on K + mu S goes on, S
    the mean stiffness, with a line search: the shift mu grows until the step goes downhill and while steps come out
    short, and falls while they come out whole (Levenberg-Marquardt), down to none. The search looks for the point along
    the step where the out-of-balance force does no more work, r.d = 0. Under dead loads that is the minimum of the
    energy along the step, and it needs no energy, so follower loads may take part. No step moves a node by more than
    `step_limit` m.
    """
    solve = _Solve(assembly, chains, loads, x0, max(atol, rounding_force(chains)), rtol, max_iterations, step_limit)
    while not solve.finished() and solve.burst():
        pass
    short, patience = 0, SHORT_STEPS
    while not solve.finished():
        s = solve.guarded_step()
        short = short + 1 if s < 0.3 else 0
        if short >= patience and not solve.finished():
            better = solve.burst()
            short, patience = 0, SHORT_STEPS if better else 2 * patience
    x = assembly.unknowns.expand(solve.q)
    unstable = solve.negative_pivots() if solve.status == "converged" else 0
    return Equilibrium(x, solve.status, len(solve.norms) - 1, tuple(solve.norms), unstable)


def rounding_force(chains):
    """Force N by which rounding of the element lengths alone may leave a structure out of balance: 4 eps ||k l0||."""
    return 4.0 * np.finfo(float).eps * float(np.sqrt(sum(np.sum((c.k * c.l0) ** 2) for c in chains)))


class _Solve:
    """State of one static solve: unknowns q, residual r, tangent k, norms met, shift, and why it ended."""

    def __init__(self, assembly, chains, loads, x0, atol, rtol, max_iterations, step_limit):
        self.assembly, self.prepared = assembly, assembly.prepare(chains, loads)
        self.atol, self.rtol = atol, rtol
        self.max_iterations, self.step_limit = max_iterations, step_limit
        self.softest = SOFTEST * max(float(c.k.max(initial=0.0)) for c in chains)
        self.mu, self.rejected, self.status = 0.0, 0, "max_iterations"
        self.norms = []
        q = assembly.unknowns.restrict(x0)
        self._accept(q, assembly.residual_and_tangent(q, self.prepared))

    def _accept(self, q, evaluated):
        self.q = q
        self.r, self.k, self.external = evaluated
        self.norm = self.assembly.unknowns.norm(self.r)
        self.norms.append(self.norm)

    def finished(self):
        """Whether the solve has ended; `status` says how."""
        if self.norm <= self.atol + self.rtol * self.external:
            self.status = "converged"
        elif not np.isfinite(self.norm):
            self.status = "not_finite"
        elif self.rejected > MOST_REJECTIONS:
            self.status = "stalled"
        else:
            return len(self.norms) > self.max_iterations
        return True

    def negative_pivots(self):
        """How many directions have negative stiffness: pivots below zero of the tangent, factorised symmetrically.

        By Sylvester's law of inertia for a symmetric tangent; that of follower loads is nearly so.
        """
        if not len(self.q):
            return 0
        try:
            factors = self._factors(SMALLEST_SHIFT * max(self.softest / SOFTEST, self._diagonal().max()), pivot=0.0)
        except RuntimeError:  # exactly singular: a mechanism, neither stable nor unstable
            return 0
        return int(np.count_nonzero(factors.U.diagonal() < 0.0))

    def burst(self):
        """Whole Newton steps, BURST at most; if they do not halve the residual, back to where they began and False."""
        before = self.q, self.r, self.k, self.external, self.norm
        start = self.norm
        for _ in range(BURST):
            step, _ = self._step(0.0)
            q = self.q + step
            self._accept(q, self.assembly.residual_and_tangent(q, self.prepared))
            if not np.isfinite(self.norm) or self.norm <= 0.1 * start or self.finished():
                break
        if self.norm < 0.5 * start or self.status == "converged":
            self.mu = 0.0
            return True
        self.status = "max_iterations"
        self.q, self.r, self.k, self.external, self.norm = before
        return False

    def guarded_step(self):
        """One shifted step, as long as it goes downhill; the fraction taken, 0 where none would do."""
        step, self.mu = self._step(self.mu)
        s, trial = self._along(step)
        if trial is None:
            self.mu = max(10.0 * self.mu, FIRST_SHIFT)
            self.rejected += 1
            return 0.0
        self.rejected = 0
        if s >= 0.9:
            self.mu = 0.2 * self.mu if self.mu > NO_SHIFT else 0.0
        elif s < 0.3:
            self.mu = max(4.0 * self.mu, FIRST_SHIFT)
        self._accept(self.q + s * step, trial)
        return s

    def _diagonal(self):
        return np.abs(self.k.data[self.assembly.diagonal])

    def _factors(self, shift, pivot=1.0):
        """Factors of the tangent with `shift` N/m added to its diagonal; pivots leave it where below `pivot` of their
        column.
        """
        shifted = self.k.copy()
        shifted.data[self.assembly.diagonal] += shift
        return spla.splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=pivot, options={"SymmetricMode": True})

    def _step(self, mu):
        """Step of the shifted tangent within the step limit, and the shift with which it goes downhill (-r.d > 0)."""
        scale = max(self.softest, float(self._diagonal().mean()))
        while True:
            try:
                step = self._factors(max(mu, SMALLEST_SHIFT) * scale).solve(-self.r)
            except RuntimeError:  # exactly singular
                step = np.full_like(self.r, np.nan)
            if np.all(np.isfinite(step)) and float(step @ self.r) < 0.0:
                break
            if mu > 1e6:
                step = -self.r / scale
                break
            mu = max(10.0 * mu, 1e-6)
        return step * min(1.0, self.step_limit / float(np.abs(step).max())), mu

    def _along(self, step):
        """Fraction s of the step where the out-of-balance force does hardly any work along it, and (r, K, ||f_ext||).

        The full step is tried with its tangent, because it is mostly taken: so it is too where it halves the residual.
        Otherwise s doubles within the step limit while r.d goes on downhill, and then false position (Illinois: Dowell
        & Jarratt 1971) finds r.d = 0 between its two signs. None if nothing but no step at all would do.
        """
        start = float(self.r @ step)
        trial = self.assembly.residual_and_tangent(self.q + step, self.prepared)
        if self.assembly.unknowns.norm(trial[0]) < 0.5 * self.norm:
            return 1.0, trial
        longest = max(1.0, self.step_limit / float(np.abs(step).max()))
        s, slope = 1.0, float(trial[0] @ step)
        low, high, slope_low, slope_high = 0.0, np.inf, start, np.inf
        for _ in range(MOST_TRIALS):
            if abs(slope) <= LINE_SEARCH * abs(start) or (slope < 0.0 and s >= longest):
                break
            if slope < 0.0:
                slope_high *= 1.0 if low == 0.0 else 0.5
                low, slope_low = s, slope
            else:  # or not finite
                slope_low *= 1.0 if high == np.inf else 0.5
                high, slope_high = s, slope
            if high == np.inf:
                s = min(2.0 * s, longest)
            else:
                share = slope_low / (slope_low - slope_high) if np.isfinite(slope_high) else 0.1
                s = low + min(max(share, 0.05), 0.95) * (high - low)
            slope = float(self.assembly.residual(self.q + s * step, self.prepared)[0] @ step)
        else:
            if low == 0.0:
                return 0.0, None
            s = low
        return s, trial if s == 1.0 else self.assembly.residual_and_tangent(self.q + s * step, self.prepared)
