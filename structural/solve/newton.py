"""Newton's method on any problem with a residual and a tangent, globalised so that slack members and mechanisms do no
harm; and the scales of elements that it needs: their stiffness, and the force that rounding leaves out of balance.
"""

from typing import Any, Protocol

import numpy as np

from . import Singular
from .linear import PIVOT, factorised, shifted

# The diagonal shift that is always there, relative to the mean stiffness: it gives directions without any stiffness
# (slack nodes without weight) a zero step instead of an infinite one, and leaves Newton's convergence untouched.
SMALLEST_SHIFT = 1e-12
# Least stiffness of the shift, relative to that of the stiffest element, where all members are slack.
SOFTEST = 1e-6
# Steps rejected one after the other, and trial lengths of a line search, before giving up.
MAX_REJECTIONS, MAX_TRIALS = 30, 12
# Largest nodal rotation in one Newton step, rad.
ROTATION_LIMIT = 0.5
# After this many steps in a row that a growing limit of translations has cut short, and that were taken whole, it
# doubles with each further one: nodes of soft structures under large loads have to go a million times as far as these
# are wide.
LIMITED_STEPS = 8
# After this many short steps in a row (below a third) full Newton steps are tried again, at most WATCHDOG_STEPS of them
# before the residual must have come down (watchdog technique of Chamberlain et al. 1982).
SHORT_STEPS, WATCHDOG_STEPS = 3, 10

EPS = float(np.finfo(float).eps)


class Problem(Protocol):
    """Equations r(u) = 0 of `rotational.size` unknowns. Where the unknowns are is the problem's own business: the
    engine hands back what `moved` gave it.
    """

    rotational: np.ndarray  # which unknowns are rotational dofs (spins), (q,) bool; the others are m
    diagonal: np.ndarray  # places of the diagonal in the data of the tangent, (q,)
    stiffest: float  # stiffness N/m of the stiffest element, see `ElementGroup.stiffness`

    def residual_and_tangent(self, at: Any) -> tuple[np.ndarray, Any, float]:
        """Residual (q,) N, its derivative as a sparse (q,q) matrix, and the norm N that tolerances are relative to."""

    def moved(self, at: Any, step: np.ndarray) -> Any:
        """Where the unknowns are after a step (q,) m and rad."""

    def norm(self, r: np.ndarray) -> float:
        """Norm N of a residual (q,)."""

    def rounding(self, at: Any) -> float:
        """Norm N of the residual that rounding alone may leave there; 0 where the tolerance has that in it."""


class Newton:
    """State of one solve: where the unknowns are (`at`), residual r, tangent k, the norms met, and the shift.

    Full Newton steps come first and are kept as long as the residual has come down after some of them (watchdog).
    Otherwise damped steps of K + mu S, S the mean stiffness: the shift mu is tied to the residual and adapts to how
    well the step did (Levenberg-Marquardt), and a line search shortens the step until the out-of-balance force along it
    no longer grows. No step moves an unknown by more than `step_limit` m or rotates a node by more than ROTATION_LIMIT;
    the first grows where step after step meets it, if it is `growing` (see LIMITED_STEPS): such a solve goes far, and
    of several equilibria it may come to a farther one.

    Converged is ||r|| <= atol + rtol ||external||, atol or what rounding leaves if that is more.
    """

    def __init__(self, problem: Problem, at: Any, atol: float, rtol: float, step_limit: float, growing: bool = False):
        self.problem, self._growing = problem, growing
        self.atol, self.rtol, self.step_limit = atol, rtol, step_limit
        self._least = SOFTEST * problem.stiffest
        self._watchdog_tried = False
        self._short, self._patience = 0, SHORT_STEPS
        self._damping, self._rejected = 1.0, 0
        self._cut, self._cut_steps = False, 0
        self._rounded: tuple[Any, float] = None, 0.0
        self.norms: list[float] = []
        self._accept(at, problem.residual_and_tangent(at))

    @property
    def status(self):
        """ "converged", or "not_finite", "stalled", or "max_iterations" of a solve that could go on."""
        if self.norm <= self.atol + self.rtol * self.external:
            return "converged"
        if not np.isfinite(self.norm):
            return "not_finite"
        if self.norm <= self._rounding() + self.rtol * self.external:
            return "converged"
        return "stalled" if self._rejected > MAX_REJECTIONS else "max_iterations"

    @property
    def iterations(self):
        """Newton iterations so far."""
        return len(self.norms) - 1

    def run(self, most):
        """Newton iterations until the solve has ended or `most` were made in all; called again it goes on."""

        def ended():
            return self.status != "max_iterations" or self.iterations >= most

        if not self._watchdog_tried:
            self._watchdog_tried = True
            while not ended() and self._watchdog(ended):
                pass
        while not ended():
            s = self._damped_step()
            self._short = self._short + 1 if s < 0.3 else 0
            if self._short >= self._patience and not ended():
                better = self._watchdog(ended)
                self._short, self._patience = 0, SHORT_STEPS if better else 2 * self._patience

    def negative_pivots(self):
        """How many directions have negative stiffness: pivots below zero of the tangent, factorised symmetrically; 0
        where it is exactly singular: a mechanism, neither stable nor unstable.

        By Sylvester's law of inertia for a symmetric tangent; that of follower loads is nearly so.
        """
        factors = self._symmetric_factors()
        return 0 if factors is None else factors.negative_pivots()

    def _symmetric_factors(self):
        """Factors of the tangent with all pivots on the diagonal; None without unknowns or where it is singular."""
        if not len(self.r):
            return None
        try:
            # relative to each unknown's own stiffness: that of axial members would hide slow modes of bending
            shift = SMALLEST_SHIFT * np.maximum(self.problem.stiffest, self._diagonal())
            return self._factors(shift, pivot=0.0)
        except Singular:
            return None

    def _accept(self, at, evaluated):
        self.at = at
        self.r, self.k, self.external = evaluated
        self.norm = self.problem.norm(self.r)
        self.norms.append(self.norm)

    def _rounding(self):
        """What rounding may leave where the unknowns are, N; asked for once."""
        if self._rounded[0] is not self.at:
            self._rounded = self.at, self.problem.rounding(self.at)
        return self._rounded[1]

    def _watchdog(self, ended):
        """Full Newton steps, WATCHDOG_STEPS at most; if they do not halve the residual, back to the start and False."""
        before = self.at, self.r, self.k, self.external, self.norm, self.step_limit
        start = self.norm
        for _ in range(WATCHDOG_STEPS):
            at = self.problem.moved(self.at, self._step(SMALLEST_SHIFT))
            self._accept(at, self.problem.residual_and_tangent(at))
            self._taken(1.0)
            if not np.isfinite(self.norm) or self.norm <= 0.1 * start or ended():
                break
        if self.norm < 0.5 * start or self.status == "converged":
            self._damping = 0.0
            return True
        self.at, self.r, self.k, self.external, self.norm, self.step_limit = before
        self._cut_steps = 0
        return False

    def _taken(self, s):
        """Count the steps in a row that were cut short by the limit and taken whole (s = 1); it grows after some."""
        self._cut_steps = self._cut_steps + 1 if self._cut and s == 1.0 else 0
        if self._growing and self._cut_steps >= LIMITED_STEPS:
            self.step_limit *= 2.0

    def _damped_step(self):
        """One shifted step with a line search; the fraction taken, 0 where none would do."""
        relative = min(self.norm / max(self.external, self.norms[0]), 1.0)
        step = self._step(max(self._damping * relative, SMALLEST_SHIFT))
        s, trial = self._line_search(step)
        self._taken(s)
        if trial is None:
            self._damping = max(10.0 * self._damping, 1e-3)
            self._rejected += 1
            return 0.0
        self._rejected = 0
        if s == 1.0:
            self._damping = 0.2 * self._damping if self._damping > 1e-8 else 0.0
        elif s < 0.3:
            self._damping = max(4.0 * self._damping, 1e-4)
        self._accept(self.problem.moved(self.at, s * step), trial)
        return s

    def _diagonal(self):
        return np.abs(self.k.data[self.problem.diagonal])

    def _factors(self, shift, pivot=PIVOT):
        """Factors of the tangent with `shift` N/m, one or (q,), added to its diagonal; it stays as it is itself."""
        return factorised(shifted(self.k, self.problem.diagonal, shift), pivot)

    def _step(self, mu):
        """Step of the shifted tangent within the step limit; the shift grows until it is one of descent (-r.d > 0)."""
        scale = self._scale()
        while True:
            try:
                step = self._factors(mu * scale).solve(-self.r)
            except Singular:
                step = np.full_like(self.r, np.nan)
            if np.all(np.isfinite(step)) and float(step @ self.r) < 0.0:
                break
            if mu > 1e6:
                step = -self.r / scale
                break
            mu = max(10.0 * mu, 1e-6)
        return self._limited(step)

    def _limited(self, step):
        """The step within the limits of translations and rotations."""
        rotational = self.problem.rotational
        angle = float(np.abs(step[rotational]).max(initial=0.0))
        distance = float(np.abs(step[~rotational]).max(initial=0.0))
        self._cut = distance > self.step_limit
        return step / max(1.0, distance / self.step_limit, angle / ROTATION_LIMIT)

    def _scale(self):
        """Mean stiffness of the translations, N/m; where there are rotational dofs, of each kind for its own unknowns
        (q,)."""
        diagonal, rotational = self._diagonal(), self.problem.rotational
        if not rotational.any():
            return self._mean(diagonal)
        scale = np.empty_like(diagonal)
        for kind in (rotational, ~rotational):
            scale[kind] = self._mean(diagonal[kind])
        return scale

    def _mean(self, diagonal):
        """Mean stiffness; where nothing has any, one that lets the residual move an unknown by 1 m or rad."""
        return max(self._least, float(diagonal.mean())) or self.norm if len(diagonal) else 0.0

    def _line_search(self, step):
        """Fraction s of the step along which the out-of-balance force r.d does not grow, and (r, K, ||f_ext||) there.

        The full step is tried with its tangent, because it is nearly always taken; None if none of MAX_TRIALS will do.
        """
        slope = float(self.r @ step)
        s = 1.0
        for _ in range(MAX_TRIALS):
            trial = self.problem.residual_and_tangent(self.problem.moved(self.at, s * step))
            slope_new = float(trial[0] @ step)
            if np.isfinite(slope_new):
                descending = slope_new < 0.0  # the minimum along the step lies still ahead
                halved = self.problem.norm(trial[0]) < 0.5 * self.norm
                if descending or abs(slope_new) <= 0.9 * abs(slope) or halved:
                    return s, trial
                s *= min(max(slope / (slope - slope_new), 0.1), 0.7)  # secant to r.d = 0
            else:
                s *= 0.1
        return s, None


def rounding_force(groups, at, reach=0.0, free=None):
    """Force N by which rounding of lengths and positions may leave a structure out of balance in the configuration
    `at`, whose coordinates are up to `reach` m: 4 eps ||k x|| over the taut springs, x their largest coordinate.
    Elements without any of the `free` nodes (n,), all without, do not count.
    """
    free = np.ones(len(at.x), dtype=bool) if free is None else free
    squares = sum(np.sum(group.rounding(at, reach)[free[group.nodes].any(axis=1)] ** 2) for group in groups)
    return 4.0 * EPS * float(np.sqrt(squares))


def rounding_of_positions(groups, at, reach):
    """Force N that rounding of coordinates of `reach` m makes: eps ||k reach||, the errors of elements being random; a
    bound for all shapes of this reach, whichever elements are taut.
    """
    return EPS * reach * float(np.sqrt(sum(np.sum(group.stiffness(at) ** 2) for group in groups)))


def stiffest(groups, at):
    """Stiffness N/m of the stiffest element in a configuration, 0 without any (see `ElementGroup.stiffness`)."""
    return max((float(group.stiffness(at).max(initial=0.0)) for group in groups), default=0.0)
