"""The circulation of every strip such that bound-vortex lift and section polar agree."""

from dataclasses import dataclass, replace

import numpy as np

from aero.polars import StripPolars

from .strips import Strips

MAX_NEWTON = 25
MAX_PSEUDO_TIME = 60
# Norm of the imbalance relative to U c / 2: influence sums round off at 1e-15, so this is close to exact.
TOLERANCE = 1e-12
# What still counts as converged when rounding stops Newton early.
ACCEPTED = 1e-9
# Artificial viscosity, tried in turn beyond stall, in units of (steepest loss of lift slope / 2 pi) (chord / strip
# width): what a sawtooth of circulation gains from its own trailing legs grows as chord / width.
VISCOSITIES = (0.2, 1.0, 4.0)
# Pseudo-time steps in a row without a smaller imbalance that end an attempt: without and with viscosity.
STALLED, STALLED_VISCOUS = 8, 12


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


def flow_angle(vn, vt):
    """atan2(vn, vt) (n,) rad; of complex arguments whose imaginary parts are small, their first-order change too."""
    alpha = np.arctan2(vn.real, vt.real)
    if not np.iscomplexobj(vn):
        return alpha
    return alpha + 1j * (vt.real * vn.imag - vn.real * vt.imag) / (vn.real**2 + vt.real**2)


@dataclass(frozen=True, eq=False)
class SectionFlow:
    """Imbalance of Kutta-Joukowski and polar lift on n strips, and its exact Jacobian (Damiani et al. 2019).

    F_i = gamma_i - c_i U_i cl_i(alpha_i) / 2 with V_i = V_inf + sum_j A_ij gamma_j, U_i the speed across the bound
    vortex and alpha_i = atan2(V_i.n_i, V_i.t_i). `influence` (3, n, n) 1/m, None is strip theory; `free_stream` (3,)
    m/s, or (n,3) where strips move. With `viscosity` (n,) the term -viscosity_i (second difference of gamma)_i is
    added. With `far_speed` W (n,) m/s, the free-stream speed across each bound vortex, U_i is replaced by U_i^2 / W_i:
    circulation from the lift of the section and the far speed.
    """

    influence: np.ndarray | None
    free_stream: np.ndarray
    strips: Strips
    polars: StripPolars
    viscosity: np.ndarray | None = None
    far_speed: np.ndarray | None = None
    from_middle: bool = False
    shift: np.ndarray | None = None

    def with_viscosity(self, used):
        """The flow with the artificial viscosity `used`, in units of (steepest loss of lift slope / 2 pi) (chord /
        strip width); none for 0.
        """
        if not used:
            return self
        unit = self.polars.steepest_fall() / (2.0 * np.pi) * self.strips.chord / self.strips.width
        return replace(self, viscosity=used * unit)

    def polar_angle(self, alpha):
        """Angles (n,) rad at which the polars are read: alpha, and the `shift` that a changed camber makes."""
        return alpha if self.shift is None else alpha + self.shift

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
        alpha = flow_angle(vn, vt)
        cl, slope, outside = self.polars.lift(self.polar_angle(alpha))
        effective = speed if self.far_speed is None else speed**2 / self.far_speed
        f = gamma - 0.5 * g.chord * effective * cl
        if self.viscosity is not None:
            f = f + self.viscosity * self._roughness(gamma)
        return f, (across, vn, vt, speed, alpha, cl, slope, outside)

    def jacobian(self, state):
        """dF/dgamma (n,n)."""
        across, vn, vt, speed, _, cl, slope, _ = state
        g = self.strips
        j = np.eye(len(speed))
        if self.viscosity is not None:
            j += self.viscosity[:, None] * self._roughness(np.eye(len(speed)))
        if self.influence is None:
            return j
        turn = (vt[:, None] * g.normal - vn[:, None] * g.tangent) / (vn * vn + vt * vt)[:, None]
        weight = 0.5 * g.chord[:, None] * ((cl / speed)[:, None] * across + (speed * slope)[:, None] * turn)
        if self.far_speed is not None:  # d(U^2 cl) = U d(U cl) + U cl dU
            weight = (weight + 0.5 * (g.chord * cl / speed)[:, None] * across) * (speed / self.far_speed)[:, None]
        for k in range(3):
            j -= weight[:, k, None] * self.influence[k]
        return j

    def _roughness(self, gamma):
        """2 gamma_i - gamma_{i+1} - gamma_{i-1} along the first axis; end strips see one neighbour only, and the middle
        strip of a mirrored wing sees its neighbour twice.
        """
        d = np.diff(gamma, axis=0)
        out = np.zeros_like(gamma)
        out[:-1] -= d
        out[1:] += d
        if self.from_middle:
            out[0] *= 2.0
        return out


def solve(flow, start):
    """Circulation near the `start` value (n,): Newton; where stall defeats it pseudo-time, then artificial viscosity.

    A viscous solution is converged to the same tolerance but is that of a regularised problem, and says so.
    """
    free = flow.free_stream
    fastest = np.linalg.norm(free) if free.ndim == 1 else np.linalg.norm(free, axis=1).max()
    scale = 0.5 * np.max(flow.strips.chord) * (fastest or 1.0) * np.sqrt(len(start))  # 1: strips at rest in the air
    gamma, count = _newton(flow, start, scale)
    used = 0.0
    if _relative(flow, gamma, scale) > ACCEPTED:
        gamma, more = _pseudo_time(flow, start, scale, STALLED)
        count += more
    if _relative(flow, gamma, scale) > ACCEPTED:
        for used in VISCOSITIES:
            flow = flow.with_viscosity(used)
            gamma, more = _pseudo_time(flow, start, scale, STALLED_VISCOUS)
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


def _pseudo_time(flow, gamma, scale, patience):
    """Implicit Euler steps of dgamma/dt = -F whose length grows as F falls (Mulder and van Leer 1985).

    Ends when `patience` steps in a row have brought no smaller F.
    """
    f, state = flow.imbalance(gamma)
    best, norm = gamma, float(np.linalg.norm(f))
    smallest, dt, waited = norm, 1.0, 0
    for count in range(MAX_PSEUDO_TIME):
        if norm <= TOLERANCE * scale:
            return gamma, count
        j = flow.jacobian(state)
        j[np.diag_indices(len(gamma))] += 1.0 / dt
        gamma = gamma - np.linalg.solve(j, f)
        f, state = flow.imbalance(gamma)
        new = float(np.linalg.norm(f))
        dt = min(max(dt * min(max(norm / new, 0.3), 3.0) if new > 0 else dt, 0.3), 1e8)
        norm = new
        waited += 1
        if new < smallest:
            best, smallest, waited = gamma, new, 0
        if waited == patience:
            return best, count + 1
    return best, MAX_PSEUDO_TIME


def attached_start(flow):
    """Circulation (n,) of the linear problem with every section at its lift slope of alpha = 0: the attached branch."""
    g = flow.strips
    cl0, slope, _ = flow.polars.lift(flow.polar_angle(np.zeros(len(g.chord))))
    free = flow.free_stream
    along, up = (d @ free if free.ndim == 1 else np.einsum("ik,ik->i", d, free) for d in (g.span, g.normal))
    across = free - along[:, None] * g.span
    speed = np.sqrt(np.einsum("ik,ik->i", across, across))
    weight = 0.5 * g.chord * slope
    right = 0.5 * g.chord * speed * cl0 + weight * up
    if flow.influence is None:
        return right
    normal_wash = np.einsum("kij,ik->ij", flow.influence, g.normal)
    return np.linalg.solve(np.eye(len(right)) - weight[:, None] * normal_wash, right)
