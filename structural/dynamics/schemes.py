"""Time integration schemes: each is the algebraic system of one step and what follows from its solution.

All are written for the displacement d since the beginning of the step to the position at which the forces are taken:
M cm (d - da) + R(q0 + d, cw (d - dw)) = 0. Small numbers stay small so, however short the step.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from .motion import State


@dataclass(frozen=True, eq=False)
class StepSystem:
    """One step's system: factors `cm` 1/s^2 and `cw` 1/s, references `da` and `dw` (u,) m, time `t` s of the forces,
    and `start` (u,) m to begin Newton's method from.
    """

    cm: float
    da: np.ndarray
    cw: float
    dw: np.ndarray
    t: float
    start: np.ndarray


class Scheme(Protocol):
    """What the time loop asks of a scheme; `order` is that of its global error."""

    order: int

    def system(self, state: State, h: float) -> StepSystem:
        """The system of a step of h s from `state`."""

    def advanced(self, state: State, h: float, d: np.ndarray) -> State:
        """The state at the end of the step with the solution d (u,) m."""

    def local_error(self, state: State, new: State, h: float) -> np.ndarray:
        """Estimate (u,) m of the error of the positions made in this step."""


def _predictor(state, h):
    """Displacement (u,) m of a step at the present acceleration."""
    return h * state.v + 0.5 * h * h * state.a


@dataclass(frozen=True)
class ImplicitEuler:
    """v1 = v0 + h a1, x1 = x0 + h v1 (PSM thesis eq. 5.9): order 1; damps whatever it does not resolve.

    An oscillation of angular frequency w decays by about e^(-w^2 h t / 2) without any damper (eq. 6.12). With `linear`
    the forces are linearised at the beginning of the step, as in the thesis (eq. 5.11), once and without a check;
    `solver` is then "direct" or "bicgstab", without preconditioner as there, and `isotropic` takes the thesis'
    derivative of damping (eq. 5.16) instead of the exact one.
    """

    linear: bool = False
    solver: Literal["direct", "bicgstab"] = "direct"
    isotropic: bool = False
    order = 1

    def system(self, state, h):
        """See `Scheme`."""
        predictor = h * state.v
        return StepSystem(1.0 / h**2, predictor, 1.0 / h, np.zeros_like(predictor), state.t + h, predictor)

    def advanced(self, state, h, d):
        """See `Scheme`."""
        v = d / h
        return State(state.t + h, state.q + d, v, (v - state.v) / h)

    def local_error(self, state, new, h):
        """Difference to the trapezoidal rule in the same velocities, h (v1 - v0) / 2."""
        return 0.5 * h * (new.v - state.v)


@dataclass(frozen=True)
class GeneralisedAlpha:
    """Generalised-alpha method (Chung and Hulbert 1993): order 2, with the damping of high frequencies in hand.

    `spectral_radius` (0 to 1) is what a step leaves of an oscillation that it does not resolve at all: 1 keeps all
    energy of linear systems, 0 takes it in one step. Forces are taken at one point within the step. Stiff lines that
    go slack and become taut again within steps that do not resolve them need 0 (or BDF2): with more than that a
    rebound may return more energy than it got.
    """

    spectral_radius: float = 0.0
    order = 2

    def __post_init__(self):
        if not 0.0 <= self.spectral_radius <= 1.0:
            raise ValueError(f"the spectral radius must lie between 0 and 1; it is {self.spectral_radius:g}.")

    @property
    def _factors(self):
        rho = self.spectral_radius
        alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        return alpha_m, alpha_f, 0.25 * (1.0 - alpha_m + alpha_f) ** 2, 0.5 - alpha_m + alpha_f

    def _newmark_predictor(self, state, h, beta):
        return h * state.v + h * h * (0.5 - beta) * state.a

    def system(self, state, h):
        """See `Scheme`."""
        alpha_m, alpha_f, beta, gamma = self._factors
        predictor = (1.0 - alpha_f) * self._newmark_predictor(state, h, beta)
        speed = (1.0 - alpha_f) * (state.v + h * (1.0 - gamma) * state.a) + alpha_f * state.v
        cm, cw = (1.0 - alpha_m) / ((1.0 - alpha_f) * beta * h * h), gamma / (beta * h)
        start = (1.0 - alpha_f) * _predictor(state, h)
        t = state.t + (1.0 - alpha_f) * h
        return StepSystem(cm, predictor - alpha_m / cm * state.a, cw, predictor - speed / cw, t, start)

    def advanced(self, state, h, d):
        """See `Scheme`."""
        _, alpha_f, beta, gamma = self._factors
        moved = d / (1.0 - alpha_f)
        a = (moved - self._newmark_predictor(state, h, beta)) / (beta * h * h)
        return State(state.t + h, state.q + moved, state.v + h * ((1.0 - gamma) * state.a + gamma * a), a)

    def local_error(self, state, new, h):
        """(beta - 1/6) h^2 (a1 - a0), the third-order term of the positions (Zienkiewicz and Xie 1991)."""
        return (self._factors[2] - 1.0 / 6.0) * h * h * (new.a - state.a)


@dataclass(frozen=True)
class BDF2:
    """Backward differentiation over two steps, of any sizes: order 2; of what it does not resolve nothing is left.

    The first step is one of the generalised-alpha method with spectral radius 0.
    """

    order = 2

    @staticmethod
    def _past(state, h):
        before, q, v = state.past
        r = h / before
        beta = (1.0 + r) / (1.0 + 2.0 * r)
        share = r * r / (1.0 + 2.0 * r)
        return beta * h, share * (state.q - q), state.v + share * (state.v - v)

    def system(self, state, h):
        """See `Scheme`."""
        if state.past is None:
            return GeneralisedAlpha(0.0).system(state, h)
        bh, moved, v = self._past(state, h)
        return StepSystem(1.0 / bh**2, moved + bh * v, 1.0 / bh, moved, state.t + h, _predictor(state, h))

    def advanced(self, state, h, d):
        """See `Scheme`."""
        past = h, state.q, state.v
        if state.past is None:
            new = GeneralisedAlpha(0.0).advanced(state, h, d)
            return State(new.t, new.q, new.v, new.a, past)
        bh, moved, v = self._past(state, h)
        speed = (d - moved) / bh
        return State(state.t + h, state.q + d, speed, (speed - v) / bh, past)

    def local_error(self, state, new, h):
        """2 h^2 (a1 - a0) / 9, the leading error of equal steps."""
        return 2.0 / 9.0 * h * h * (new.a - state.a)


SCHEMES = {"implicit-euler": ImplicitEuler, "generalised-alpha": GeneralisedAlpha, "bdf2": BDF2}
