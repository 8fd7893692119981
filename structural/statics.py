"""Static equilibrium: Newton on the true residual, globalised so that slack members and mechanisms do no harm."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg as spla

from .assembly import Assembly
from .beams import Beams
from .chains import Chains
from .stiffness import rounding_force, softened_stages
from .structure import Loads

# The shift that is always there, relative to the mean stiffness: it gives directions without any stiffness (slack
# nodes without weight) a zero step instead of an infinite one, and leaves Newton's convergence untouched.
SMALLEST_SHIFT = 1e-12
# Least stiffness of the shift, relative to that of the stiffest element, where all members are slack.
SOFTEST = 1e-6
# A pivot leaves the diagonal only where it is below this part of its column: elsewhere the fill stays that of the order
# in which the assembly numbers the unknowns. Steps are checked by their direction and residual, not by their digits.
# With a hundredth instead, a net of 20201 nodes with slack zones takes 2.6 times as long to factorise.
PIVOT = 1e-6
# Steps refused one after the other, and cuts of one step, before giving up.
MOST_REJECTIONS, MOST_CUTS = 30, 12
# Newton iterations after which lines and ropes that are stiff for their loads are softened (see `stiffness.softened`);
# each stage takes SOFT_ITERATIONS at most, to SOFT_RTOL of the load.
STRAIGHT, SOFT_ITERATIONS, SOFT_RTOL = 200, 200, 1e-2
# Largest turn of a frame in one Newton step, rad.
TURN_LIMIT = 0.5
# After this many short steps in a row (below a third) whole Newton steps are tried again, at most BURST of them.
SHORT_STEPS, BURST = 3, 10


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Result of a static solve: `x` (n,3) m, `status` "converged" or why not, the residual norms N met on the way (also
    with softened lines), in how many directions the converged equilibrium is unstable under its loads (0: it is
    stable), and the `rotations` (r,3,3) of the frames, None without any. The norm takes moments in N m beside forces in
    N.
    """

    x: np.ndarray
    status: str
    iterations: int
    residuals: tuple[float, ...]
    unstable_modes: int = 0
    rotations: np.ndarray | None = None

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
    max_iterations: int = 600,
    step_limit: float = 1.0,
    beams: tuple[Beams, ...] | None = None,
    rotations: np.ndarray | None = None,
) -> Equilibrium:
    """Positions where internal and external forces balance: ||r|| <= atol + rtol ||f_ext||, in newtons.

    Where the elements are so stiff that rounding of their lengths alone makes larger forces, that rounding is the
    tolerance.

    Whole Newton steps come first and are kept as long as each burst of them lowers the residual: that is all a warm
    start needs, and it is what stiff members need that turn by a large angle. Otherwise Newton on K + mu S goes on, S
    the mean stiffness: the shift mu is tied to the residual and adapts to how well the step did (Levenberg-Marquardt;
    quadratic convergence at the end also with mechanisms), and a step is shortened until the out-of-balance force
    along it no longer grows. For tension-only members under dead loads that is a line search on a convex energy, and
    it needs no energy, so follower loads may take part. No step moves a node by more than `step_limit` m, or turns it
    by more than TURN_LIMIT. `beams` replace those of the structure (their sections may change, as the chains' rest
    lengths do), `rotations` (r,3,3) are those to start from.

    Stiff lines that turn far under light loads are a narrow curved valley, in which straight steps are short. So where
    all this takes long, it begins anew with soft lines, which are stiffened by degrees.
    """
    beams = assembly.structure.beams if beams is None else beams
    reach = float(np.abs(assembly.structure.nodes).max(initial=0.0))
    tolerance = max(atol, rounding_force(chains, beams, reach))
    at = assembly.unknowns.restrict(x0), assembly.start(rotations)

    def begun(members, at, rtol):
        return NewtonSolve(assembly, assembly.prepare(members, loads, beams), members, at, tolerance, rtol, step_limit)

    solve = direct = begun(chains, at, rtol)
    solve.run(min(STRAIGHT, max_iterations))
    slow = len(solve.norms) <= max_iterations and solve.status in ("max_iterations", "stalled")
    softened = softened_stages(chains, solve.external) if slow else []
    if slow and not softened:
        solve.run(max_iterations)
    norms, iterations = list(solve.norms), len(solve.norms) - 1
    for members in (*softened, chains) if softened else ():
        left = max(max_iterations - iterations, 0)
        soft = members is not chains
        solve = begun(members, at, max(rtol, SOFT_RTOL) if soft else rtol)
        solve.run(min(SOFT_ITERATIONS, left) if soft else left)
        norms += solve.norms
        iterations += len(solve.norms) - 1
        at = solve.at
    if solve.status != "converged" and solve.norm > direct.norm:  # softening has not helped
        solve = direct
        norms.append(solve.norm)
    q, turned = solve.at
    unstable = solve.negative_pivots() if solve.status == "converged" else 0
    x = assembly.positions(q, turned)
    return Equilibrium(x, solve.status, iterations, tuple(norms), unstable, turned)


class NewtonSolve:
    """State of one solve: unknowns and rotations `at`, residual r, tangent k, norms met, shift, why it ended."""

    def __init__(self, assembly, prepared, chains, at, atol, rtol, step_limit):
        self.assembly, self.prepared = assembly, prepared
        self.turning = assembly.unknowns.turning
        self.atol, self.rtol = atol, rtol
        self.max_iterations, self.step_limit = 0, step_limit
        self.short, self.patience = 0, SHORT_STEPS
        self.softest = SOFTEST * max((float(c.k.max(initial=0.0)) for c in chains), default=0.0)
        self.damping, self.rejected, self.status = 1.0, 0, "max_iterations"
        self.norms = []
        self._accept(at, self._evaluated(at))

    def run(self, max_iterations):
        """Newton iterations until the solve has ended; called again with more of them it goes on."""
        begun, self.max_iterations = self.max_iterations > 0, max_iterations
        while not begun and not self.finished() and self.burst():
            pass
        while not self.finished():
            s = self.guarded_step()
            self.short = self.short + 1 if s < 0.3 else 0
            if self.short >= self.patience and not self.finished():
                better = self.burst()
                self.short, self.patience = 0, SHORT_STEPS if better else 2 * self.patience

    def _evaluated(self, at):
        q, rotations = at
        return self.assembly.residual_and_tangent(q, self.prepared, rotations)

    def _accept(self, at, evaluated):
        self.at = at
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
        if not len(self.r):
            return 0
        try:
            # relative to each unknown's own stiffness: that of axial members would hide slow modes of bending
            factors = self._factors(SMALLEST_SHIFT * np.maximum(self.softest / SOFTEST, self._diagonal()), pivot=0.0)
        except RuntimeError:  # exactly singular: a mechanism, neither stable nor unstable
            return 0
        return int(np.count_nonzero(factors.U.diagonal() < 0.0))

    def burst(self):
        """Whole Newton steps, BURST at most; if they do not halve the residual, back to where they began and False."""
        before = self.at, self.r, self.k, self.external, self.norm
        start = self.norm
        for _ in range(BURST):
            step = self._step(SMALLEST_SHIFT)
            at = self.assembly.moved(*self.at, step)
            self._accept(at, self._evaluated(at))
            if not np.isfinite(self.norm) or self.norm <= 0.1 * start or self.finished():
                break
        if self.norm < 0.5 * start or self.status == "converged":
            self.damping = 0.0
            return True
        self.status = "max_iterations"
        self.at, self.r, self.k, self.external, self.norm = before
        return False

    def guarded_step(self):
        """One shifted step, shortened as far as needed; the fraction taken, 0 where none would do."""
        relative = min(self.norm / max(self.external, self.norms[0]), 1.0)
        step = self._step(max(self.damping * relative, SMALLEST_SHIFT))
        s, trial = self._along(step)
        if trial is None:
            self.damping = max(10.0 * self.damping, 1e-3)
            self.rejected += 1
            return 0.0
        self.rejected = 0
        if s == 1.0:
            self.damping = 0.2 * self.damping if self.damping > 1e-8 else 0.0
        elif s < 0.3:
            self.damping = max(4.0 * self.damping, 1e-4)
        self._accept(self.assembly.moved(*self.at, s * step), trial)
        return s

    def _diagonal(self):
        return np.abs(self.k.data[self.assembly.diagonal])

    def _factors(self, shift, pivot=PIVOT):
        """Factors of the tangent with `shift` N/m, one or (q,), added to its diagonal; pivots leave it where below
        `pivot` of their column.
        """
        data = self.k.data.copy()
        data[self.assembly.diagonal] += shift
        options = {"SymmetricMode": True}
        return spla.splu(self.assembly.matrix(data), permc_spec="NATURAL", diag_pivot_thresh=pivot, options=options)

    def _step(self, mu):
        """Step of the shifted tangent within the step limit; the shift grows until it goes downhill (-r.d > 0)."""
        scale = self._scale()
        while True:
            try:
                step = self._factors(mu * scale).solve(-self.r)
            except RuntimeError:  # exactly singular
                step = np.full_like(self.r, np.nan)
            if np.all(np.isfinite(step)) and float(step @ self.r) < 0.0:
                break
            if mu > 1e6:
                step = -self.r / scale
                break
            mu = max(10.0 * mu, 1e-6)
        turn = float(np.abs(step[self.turning]).max(initial=0.0))
        shift = float(np.abs(step[~self.turning]).max(initial=0.0))
        return step / max(1.0, shift / self.step_limit, turn / TURN_LIMIT)

    def _scale(self):
        """Mean stiffness of the translations, N/m; where there are spins, of each kind for its own unknowns (q,)."""
        diagonal = self._diagonal()
        if not self.turning.any():
            return max(self.softest, float(diagonal.mean()))
        scale = np.empty_like(diagonal)
        for kind in (self.turning, ~self.turning):
            scale[kind] = max(self.softest, float(diagonal[kind].mean())) if kind.any() else 0.0
        return scale

    def _along(self, step):
        """Fraction s of the step along which the out-of-balance force r.d does not grow, and (r, K, ||f_ext||) there.

        The full step is tried with its tangent, because it is nearly always taken; None if no fraction will do.
        """
        slope = float(self.r @ step)
        s = 1.0
        for _ in range(MOST_CUTS):
            trial = self._evaluated(self.assembly.moved(*self.at, s * step))
            slope_new = float(trial[0] @ step)
            if np.isfinite(slope_new):
                downhill = slope_new < 0.0  # the minimum along the step lies still ahead
                halved = self.assembly.unknowns.norm(trial[0]) < 0.5 * self.norm
                if downhill or abs(slope_new) <= 0.9 * abs(slope) or halved:
                    return s, trial
                s *= min(max(slope / (slope - slope_new), 0.1), 0.7)  # secant to r.d = 0
            else:
                s *= 0.1
        return s, None
