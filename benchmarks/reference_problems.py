"""Coupled reference problems in plain numpy: each offers x0, G(x) and, when it marches in time, advance(x).

`REFERENCES` lists them with their tolerances and what peers need; `march` counts what a scheme needs.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from master.coupling.fixed_point import fixed_point

from .reference_tubes import RingWallTube, Tube


class Linear:
    """G(x) = Q diag(-3 * 0.8^i) Q^T x + b."""

    def __init__(self, n=100, first=-3.0, ratio=0.8, seed=0):
        rng = np.random.default_rng(seed)
        Q, _ = np.linalg.qr(rng.standard_normal((n, n)))
        self.eigenvalues = first * ratio ** np.arange(n)
        self.A = (Q * self.eigenvalues) @ Q.T
        self.b = rng.standard_normal(n)
        self.x0 = np.zeros(n)

    def G(self, x):
        return self.A @ x + self.b

    def solution(self):
        return np.linalg.solve(np.eye(self.b.size) - self.A, self.b)


class BadlyScaledFields:
    """u <- s_u (M tanh(0.05 p/s_p)/0.05 + b_u), p <- s_p (-M u/s_u + b_p): the parallel scheme, 1e-3 beside 1e5."""

    def __init__(self, n=50, s_u=1e-3, s_p=1e5, seed=0):
        rng = np.random.default_rng(seed)
        Q, _ = np.linalg.qr(rng.standard_normal((n, n)))
        self.M = (Q * (2.0 * 0.85 ** np.arange(n))) @ Q.T
        self.b_u, self.b_p = 0.5 * rng.standard_normal((2, n))
        self.s_u, self.s_p = s_u, s_p
        self.x0 = np.zeros(2 * n)
        self.fields = {"displacement": slice(0, n), "pressure": slice(n, 2 * n)}

    def G(self, x):
        u, p = (x[s] for s in self.fields.values())
        return np.concatenate(
            (
                self.s_u * (self.M @ np.tanh(0.05 * p / self.s_p) / 0.05 + self.b_u),
                self.s_p * (-self.M @ u / self.s_u + self.b_p),
            )
        )


class AddedMass:
    """Modes of an elastic wall beside an inviscid channel flow (Causin, Gerbeau, Nobile 2005)."""

    rho_f, rho_s, R, L, a, dt = 1.0, 1.1, 0.5, 6.0, 4e5, 1e-4

    def __init__(self, h=0.1, scale=1.0):
        i = np.arange(1, 31)
        self.h = h
        self.mu = self.L / (i * np.pi * np.tanh(i * np.pi * self.R / self.L))
        self.p_ext = scale * 2e4 / i
        self.eta1 = np.zeros(30)
        self.eta2 = np.zeros(30)

    @property
    def x0(self):
        return self.eta1

    @property
    def critical_omega(self):
        """Largest stable constant relaxation factor, 2 (rho_s h + a dt^2) / (rho_s h + rho_f mu_max + a dt^2)."""
        wall = self.rho_s * self.h + self.a * self.dt**2
        return 2.0 * wall / (wall + self.rho_f * self.mu.max())

    def G(self, x):
        p = self.p_ext - self.rho_f * self.mu * (x - 2.0 * self.eta1 + self.eta2) / self.dt**2
        inertia = self.rho_s * self.h / self.dt**2
        return (p + inertia * (2.0 * self.eta1 - self.eta2)) / (inertia + self.a)

    def advance(self, x):
        self.eta2, self.eta1 = self.eta1, x


@dataclass(frozen=True)
class March:
    """Evaluations of G in each converged step, and the number of the step that did not converge (0: all did)."""

    counts: tuple[int, ...]
    failed: int = 0
    message: str = ""

    @property
    def mean(self):
        """Mean evaluations of G a step; nan where a step failed."""
        return math.nan if self.failed else float(np.mean(self.counts))


def march(problem, scheme, steps, parallel=False, **options):
    """The steps of a problem with one scheme, which keeps its history; ends at the first step that fails."""
    counts: list[int] = []
    for k in range(steps):
        G, x0 = (problem.parallel_G, problem.parallel_x0) if parallel else (problem.G, problem.x0)
        result = fixed_point(G, x0, scheme, **options)
        if result.status != "converged":
            return March(tuple(counts), k + 1, result.message)
        counts.append(result.iterations)
        if k + 1 < steps:
            problem.advance(result.x)
    return March(tuple(counts))


@dataclass(frozen=True)
class Reference:
    """A problem with its number of steps and its tolerances.

    `precice` is what preCICE 3.4.1 needs (default: QR3 1e-2, residual-sum scaling, reuse of ten steps), mean
    evaluations of G a step, as published; `bound` is what our IQN-ILS may need. None where that is not known.
    """

    name: str
    make: Callable[[], Any]
    steps: int
    options: dict[str, Any]
    precice: float | None
    bound: float | None
    parallel: bool = False
    fields: dict[str, slice] | None = None

    def march(self, scheme, steps=None, **options):
        """All steps or the first `steps` with a scheme; further options go to `fixed_point`."""
        steps = min(steps or self.steps, self.steps)
        return march(self.make(), scheme, steps, self.parallel, fields=self.fields, **self.options, **options)


def stiff_tube():
    """Elastic tube of kappa = 10."""
    return Tube(10.0, 0.01, lambda t: 10.0 + math.sin(10.0 * math.pi * t))


def stiffer_tube():
    """Elastic tube of kappa = 100."""
    return Tube(100.0, 0.001, lambda t: 10.0 + math.sin(100.0 * math.pi * t))


REFERENCES = (
    Reference("linear", Linear, 1, {"residual_rtol": 1e-8}, 15, 15),
    Reference(
        "two badly scaled fields", BadlyScaledFields, 1, {"rtol": 1e-8}, 26, 26, fields=BadlyScaledFields().fields
    ),
    Reference("added mass, h = 0.1", AddedMass, 20, {"residual_rtol": 1e-8}, 3.40, 3.40),
    Reference("added mass, h = 1", lambda: AddedMass(1.0), 20, {"residual_rtol": 1e-8}, 2.75, 2.75),
    Reference("elastic tube", Tube, 100, {"residual_rtol": 1e-5}, 6.74, 6.7),
    Reference("elastic tube, parallel", Tube, 100, {"rtol": 1e-5}, 8.5, 8.5, parallel=True, fields=Tube().fields),
    Reference("elastic tube, κ = 10", stiff_tube, 60, {"residual_rtol": 1e-6}, 6.25, 6.2),
    Reference("elastic tube, κ = 100", stiffer_tube, 60, {"residual_rtol": 1e-6}, 5.15, 5.1),
    # bound: iqnils of Kratos 10.4.4 with the best settings tried, `benchmarks run coupling.reference`
    Reference("tube with ring wall", RingWallTube, 100, {"residual_rtol": 1e-6}, None, 3.71),
)
