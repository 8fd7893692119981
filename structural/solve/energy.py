"""Newton's method that goes down in potential energy: for membranes that wrinkle, which have no stiffness across their
tension, none at all where they are slack, and none across their plane where they start flat.

Far from equilibrium a residual says little about them: it rises a hundredfold while a flat membrane is blown up. The
potential does: that of a relaxed membrane is convex but for the pressure. A step of K + mu (S + W L), S the mean
stiffness and L the Laplacian of the membranes, is judged by the share rho of the decrease that its quadratic model
promised (trust region in the form of Levenberg and Marquardt): mu falls after good steps and rises after bad ones,
which are shortened until the potential falls. Near equilibrium mu goes to zero with the residual, so that the end is
Newton's own, quadratic; the residual itself has neither shift nor damping in it.

An inflated membrane with a free rim has many equilibria, which differ in where the rim has folded. L keeps neighbouring
nodes together while it is blown up, as a viscosity would, so that it comes to one with few folds and none of them deep.
Newton's end may be at a saddle between two of them: from there it goes down, along a direction in which fabric is
unstable, and on to one that is stable.
"""

from typing import Any, Protocol

import numpy as np

from . import Singular
from .linear import factorised, shifted
from .newton import SMALLEST_SHIFT, Newton, Problem

# The shift at the start, relative to the mean stiffness, and its factor after good and bad steps.
FIRST_SHIFT, FACTOR = 1e-3, 3.0
# Least of the mean stiffness, where all is slack, over that of the elements when they are taut.
LEAST_UNIT = 0.1
# Weight of the Laplacian in it, in the middle of what serves. With a third, or ten times as much, the rim of some
# airbags of 3600 to 10,000 triangles folds so deep at the middle of its sides that it goes through the planes of
# symmetry: an equilibrium too, even one of less energy, but not one of a bag that cannot pass through itself. With this
# weight none does, of all meshes of squares cut in four from 16 to 10,000 triangles.
SMOOTHING = 300.0
# A step is good above, and bad below, this share of the promised decrease; it must leave some.
GOOD, BAD, LEAST = 0.7, 0.25, 1e-3
# A step that does not go down is shortened to this part, that often at most.
SHORTER, SHORTENINGS = 0.3, 3
# Saddles that a solve leaves, by steps of LEAVING m first, which are shortened that often at most.
SADDLES, LEAVING, LEAVING_SHORTENINGS = 5, 1e-3, 6
# Below this residual, relative to the load, the shift falls with it.
NEAR = 1e-3
# Full steps are tried first where the start is that near, as long as the residual stays below GROWTH of it.
WARM, WARM_STEPS, GROWTH = 0.3, 6, 30.0
# Decreases below this part of the energy drown in rounding; work along the step, from both ends, replaces them.
DROWNED = 1e-12
# A pivot leaves the diagonal only where it is nothing but rounding. Slack membranes have such pivots everywhere, and
# the fill of others would make factors many times larger.
PIVOT = 1e-13


class EnergyProblem(Problem, Protocol):
    """A `Problem` that knows how its potential energy changes."""

    mean_stiffness: float  # of the elements, N/m

    def smoothing(self, at: Any) -> Any:
        """The Laplacian of what wrinkles, on the pattern of the tangent; None without."""

    def energy(self, at: Any) -> float | None:
        """Internal energy J; None where elements have none."""

    def external_work(self, at: Any, step: np.ndarray) -> float:
        """Work J of the external forces along a straight step (q,) m."""

    def residual(self, at: Any) -> np.ndarray:
        """Residual (q,) N alone."""


class EnergyNewton(Newton):
    """Newton iterations that lower the potential; `Newton` says what else it has and when it has converged."""

    problem: EnergyProblem

    def __init__(
        self, problem: EnergyProblem, at: Any, atol: float, rtol: float, step_limit: float, growing: bool = False
    ):
        super().__init__(problem, at, atol, rtol, step_limit, growing)
        self._energy = problem.energy(at)
        least = np.where(problem.rotational, 0.0, LEAST_UNIT * problem.mean_stiffness)
        self._unit = np.maximum(self._scale(), least)
        self._smoothing = problem.smoothing(at)
        self._damping = FIRST_SHIFT * min(1.0, self._relative)
        self._saddles = 0
        self._negative: tuple[Any, int] = None, 0

    @property
    def _relative(self):
        """Residual relative to the load, or to that of the start where supports have moved."""
        return self.norm / max(self.external, self.norms[0], 1e-300)

    def run(self, most):
        """See Newton."""

        def ended():
            return self.status != "max_iterations" or self.iterations >= most

        if not self._watchdog_tried and not ended() and self._relative <= WARM:
            self._full_steps(ended)
        self._watchdog_tried = True
        while not ended():
            self._damped_step()
        while self.status == "converged" and self._saddles < SADDLES:
            saddle = self.at, self.r, self.k, self.external, self.norm
            if not self._leave_saddle():
                break
            while not ended():
                self._damped_step()
            if self.status != "converged":  # an equilibrium all the same
                self.at, self.r, self.k, self.external, self.norm = saddle
                self.norms.append(self.norm)
                break

    def negative_pivots(self):
        """See Newton."""
        if self._negative[0] is not self.at:
            self._negative = self.at, super().negative_pivots()
        return self._negative[1]

    def _leave_saddle(self):
        """Goes down from a converged state along a direction in which membranes are unstable; whether there is one.

        Of others, such as struts, the instability is told and not left: that they buckle is for their user to know.
        """
        factors = self._symmetric_factors()
        self._negative = self.at, 0 if factors is None else factors.negative_pivots()
        if self._smoothing is None or factors is None:
            return False
        direction = factors.negative_direction()
        if direction is None or not np.all(np.isfinite(direction)):
            return False
        fabric = self._smoothing.data[self.problem.diagonal] > 0.0
        if np.sum(direction[fabric] ** 2) < 0.5 * np.sum(direction**2):
            return False
        self._saddles += 1
        step = direction * (LEAVING / np.abs(direction).max())
        for _ in range(LEAVING_SHORTENINGS):
            falls = {sign: self._fall(sign * step) for sign in (1.0, -1.0)}
            sign = max(falls, key=lambda s: falls[s])
            if falls[sign] > 0.0:
                at = self.problem.moved(self.at, sign * step)
                self._accept(at, self.problem.residual_and_tangent(at))
                self._energy = self.problem.energy(at)
                self._damping = FIRST_SHIFT * min(1.0, self._relative)
                return True
            step = SHORTER * step
        return False

    def _fall(self, step):
        """By how much the potential falls along a step, J; 0 where that drowns in rounding."""
        promised = max(-float(self.r @ step) - 0.5 * float(step @ (self.k @ step)), 0.0)
        return promised * self._share(step, promised)[0] if promised > 0.0 else 0.0

    def _full_steps(self, ended):
        """Newton steps as they come; back to the start where they lead nowhere."""
        before = self.at, self.r, self.k, self.external, self.norm
        start = self.norm
        for _ in range(WARM_STEPS):
            step = self._shifted_step(0.0)
            if step is None:
                break
            at = self.problem.moved(self.at, step)
            self._accept(at, self.problem.residual_and_tangent(at))
            if not self.norm <= GROWTH * start or ended():
                break
        if self.status != "converged" and not self.norm <= 0.1 * start:
            self.at, self.r, self.k, self.external, self.norm = before
            self.norms.append(self.norm)
        self._energy = self.problem.energy(self.at)
        self._damping = FIRST_SHIFT * min(1.0, self._relative)

    def _damped_step(self):
        """One shifted step, shortened until the potential falls; nothing but a larger shift where it does not."""
        step = self._shifted_step(self._damping * min(1.0, self._relative / NEAR))
        slope = np.nan if step is None else float(self.r @ step)
        curvature = np.nan if step is None else float(step @ (self.k @ step))
        if not (slope < 0.0 and -slope - 0.5 * curvature > 0.0):  # no descent, or none that the model knows of
            self._reject()
            return 0.0
        s, first = 1.0, None
        for _ in range(SHORTENINGS + 1):
            promised = -s * slope - 0.5 * s * s * curvature
            share, evaluated, energy = self._share(s * step, promised)
            first = share if first is None else first
            if share > LEAST:
                break
            s *= SHORTER
        else:
            self._reject()
            return 0.0
        at = self.problem.moved(self.at, s * step)
        self._accept(at, self.problem.residual_and_tangent(at) if evaluated is None else evaluated)
        self._energy, self._rejected = energy, 0
        if first > GOOD:
            self._damping /= FACTOR
        elif first < BAD:
            self._damping *= FACTOR
        return s

    def _reject(self):
        self._damping = max(FACTOR**2 * self._damping, 1e-8)
        self._rejected += 1

    def _share(self, step, promised):
        """Decrease of the potential by a step over the promised one; residual and tangent there if they were needed,
        else None; the internal energy there.
        """
        at = self.problem.moved(self.at, step)
        energy = self.problem.energy(at)
        if energy is not None and self._energy is not None:
            work = self.problem.external_work(self.at, step)
            if promised > DROWNED * (abs(energy) + abs(self._energy) + abs(work)):
                return (self._energy - energy + work) / promised, None, energy
            evaluated = self.problem.residual_and_tangent(at)
            ends = float(self.r @ step), float(evaluated[0] @ step)
            return -0.5 * sum(ends) / promised, evaluated, energy
        middle = self.problem.residual(self.problem.moved(self.at, 0.5 * step))
        evaluated = self.problem.residual_and_tangent(at)
        along = (float(self.r @ step) + 4.0 * float(middle @ step) + float(evaluated[0] @ step)) / 6.0
        return -along / promised, evaluated, energy

    def _shifted_step(self, mu):
        """Step (q,) of the tangent with a shift, within the step limit; None where that is singular."""
        matrix = shifted(self.k, self.problem.diagonal, np.maximum(mu, SMALLEST_SHIFT) * self._unit)
        if mu > 0.0 and self._smoothing is not None:
            matrix.data += (SMOOTHING * mu) * self._smoothing.data
        try:
            step = factorised(matrix, PIVOT).solve(-self.r)
        except Singular:
            return None
        return self._limited(step) if np.all(np.isfinite(step)) else None
