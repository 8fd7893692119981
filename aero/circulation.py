"""The circulation of every strip such that bound-vortex lift and section polar agree."""

from dataclasses import dataclass

import numpy as np

from .polars import StripPolars
from .strips import Strips

MAX_NEWTON = 25
MAX_PSEUDO_TIME = 60
# Norm of the imbalance relative to U c / 2: influence sums round off at 1e-15, so this is close to exact.
TOLERANCE = 1e-12
# What still counts as converged when rounding stops Newton early.
ACCEPTED = 1e-9
# Artificial viscosity, in units of the largest loss of lift slope over 2 pi, tried in turn beyond stall.
VISCOSITIES = (0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True, eq=False)
class Circulation:
    """Solution on n strips: `gamma` (n,) m^2/s, and `alpha` (n,) rad, `speed` (n,) m/s at the control points.

    `outside` (n,) bool marks angles beyond the polar tables; `viscosity` is the artificial one that the result contains
    (0: none); `residual` is the norm of the imbalance relative to U c / 2.
    """

    gamma: np.ndarray
    alpha: np.ndarray
    speed: np.ndarray
    outside: np.ndarray
    converged: bool
    newton_iterations: int
    residual: float
    viscosity: float = 0.0


@dataclass(frozen=True, eq=False)
class SectionFlow:
    """Imbalance of Kutta-Joukowski and polar lift on n strips, and its exact Jacobian (Damiani et al. 2019).

    F_i = gamma_i - c_i U_i cl_i(alpha_i) / 2 with V_i = V_inf + sum_j A_ij gamma_j, U_i the speed across the bound
    vortex and alpha_i = atan2(V_i.n_i, V_i.t_i). `influence` (3, n, n) 1/m, None is strip theory; `free_stream` (3,)
    m/s. With `viscosity` (n,) the term -viscosity_i (second difference of gamma)_i is added.
    """

    influence: np.ndarray | None
    free_stream: np.ndarray
    strips: Strips
    polars: StripPolars
    viscosity: np.ndarray | None = None

    def imbalance(self, gamma):
        """F (n,), and the state that the Jacobian and the result need."""
        g = self.strips
        v = np.broadcast_to(self.free_stream, g.normal.shape)
        if self.influence is not None:
            v = v + (self.influence @ gamma).T
        across = v - np.einsum("ik,ik->i", v, g.span)[:, None] * g.span
        speed = np.sqrt(np.einsum("ik,ik->i", across, across))
        vn = np.einsum("ik,ik->i", v, g.normal)
        vt = np.einsum("ik,ik->i", v, g.tangent)
        alpha = np.arctan2(vn, vt)
        cl, slope, outside = self.polars.lift(alpha)
        f = gamma - 0.5 * g.chord * speed * cl
        if self.viscosity is not None:
            f = f + self.viscosity * _second_difference(gamma)
        return f, (across, vn, vt, speed, alpha, cl, slope, outside)

    def jacobian(self, state):
        """dF/dgamma (n,n)."""
        across, vn, vt, speed, _, cl, slope, _ = state
        g = self.strips
        j = np.eye(len(speed))
        if self.influence is None:
            return j
        turn = (vt[:, None] * g.normal - vn[:, None] * g.tangent) / (vn * vn + vt * vt)[:, None]
        weight = 0.5 * g.chord[:, None] * ((cl / speed)[:, None] * across + (speed * slope)[:, None] * turn)
        for k in range(3):
            j -= weight[:, k, None] * self.influence[k]
        if self.viscosity is not None:
            j += self.viscosity[:, None] * _second_difference(np.eye(len(speed)))
        return j


def _second_difference(gamma):
    """-(gamma_{i+1} - 2 gamma_i + gamma_{i-1}) along the first axis, with the end strips seeing one neighbour only."""
    d = np.diff(gamma, axis=0)
    out = np.zeros_like(gamma)
    out[:-1] -= d
    out[1:] += d
    return out


def solve(flow, start):
    """Circulation near the `start` value (n,): Newton; where stall defeats it pseudo-time, then artificial viscosity.

    A viscous solution is converged to the same tolerance but is that of a regularised problem, and says so.
    """
    scale = 0.5 * np.max(flow.strips.chord) * np.linalg.norm(flow.free_stream) * np.sqrt(len(start))
    gamma, count = _newton(flow, start, scale)
    used = 0.0
    if _relative(flow, gamma, scale) > ACCEPTED:
        gamma, more = _pseudo_time(flow, start, scale)
        count += more
    if _relative(flow, gamma, scale) > ACCEPTED:
        fall = np.maximum(-flow.imbalance(gamma)[1][6], 0.0).max() / (2.0 * np.pi)
        for used in VISCOSITIES:
            nu = np.full(len(gamma), used * max(fall, 0.1))
            flow = SectionFlow(flow.influence, flow.free_stream, flow.strips, flow.polars, nu)
            gamma, more = _pseudo_time(flow, start, scale)
            count += more
            if _relative(flow, gamma, scale) <= ACCEPTED:
                break
    f, (_, _, _, speed, alpha, _, _, outside) = flow.imbalance(gamma)
    residual = float(np.linalg.norm(f) / scale)
    return Circulation(gamma, alpha, speed, outside, residual <= ACCEPTED, count, residual, used)


def _relative(flow, gamma, scale):
    return np.linalg.norm(flow.imbalance(gamma)[0]) / scale


def _newton(flow, gamma, scale):
    """Damped Newton from gamma: the best circulation found and the number of Newton iterations."""
    f, state = flow.imbalance(gamma)
    norm = np.linalg.norm(f)
    for count in range(MAX_NEWTON):
        if norm <= TOLERANCE * scale:
            return gamma, count
        step = np.linalg.solve(flow.jacobian(state), -f)
        s = 1.0
        while s > 0.02:
            f_new, state_new = flow.imbalance(gamma + s * step)
            norm_new = np.linalg.norm(f_new)
            if norm_new <= (1.0 - 1e-3 * s) * norm:
                break
            s *= 0.5
        else:
            return gamma, count + 1
        gamma, f, state, norm = gamma + s * step, f_new, state_new, norm_new
    return gamma, MAX_NEWTON


def _pseudo_time(flow, gamma, scale):
    """Implicit Euler steps of dgamma/dt = -F whose length grows as F falls (Mulder and van Leer 1985)."""
    f, state = flow.imbalance(gamma)
    best, first = gamma, np.linalg.norm(f)
    smallest, dt = first, 1.0
    norm = first
    for count in range(MAX_PSEUDO_TIME):
        if norm <= TOLERANCE * scale:
            return gamma, count
        j = flow.jacobian(state)
        j[np.diag_indices(len(gamma))] += 1.0 / dt
        gamma = gamma - np.linalg.solve(j, f)
        f, state = flow.imbalance(gamma)
        new = np.linalg.norm(f)
        dt = min(max(dt * min(max(norm / new, 0.3), 3.0) if new > 0 else dt, 0.3), 1e8)
        norm = new
        if new < smallest:
            best, smallest = gamma, new
    return best, MAX_PSEUDO_TIME


def attached_start(flow):
    """Circulation (n,) of the linear problem with every section at its lift slope of alpha = 0: the attached branch."""
    g = flow.strips
    cl0, slope, _ = flow.polars.lift(np.zeros(len(g.chord)))
    free = flow.free_stream
    across = free - (g.span @ free)[:, None] * g.span
    speed = np.sqrt(np.einsum("ik,ik->i", across, across))
    weight = 0.5 * g.chord * slope
    right = 0.5 * g.chord * speed * cl0 + weight * (g.normal @ free)
    if flow.influence is None:
        return right
    normal_wash = np.einsum("kij,ik->ij", flow.influence, g.normal)
    return np.linalg.solve(np.eye(len(right)) - weight[:, None] * normal_wash, right)
