"""Tubes with a flow inside, coupled problems in one dimension: x0, G(x) and, after each step, advance(x)."""

import math

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded, solve_banded

NEWTON_ITERATIONS = 30


class Tube:
    """Blood flow in a 1D elastic tube; G maps areas -> pressures -> areas (preCICE elastic-tube-1d, Degroote 2008).

    `kappa` selects E = 2 pi^(-1/2) (10 kappa)^2, else E = 1e4. The flow's unknowns are interleaved, v_0, p_0, v_1, ...,
    so that its Jacobian has four bands on either side: in band storage, entry (row, column) is J[4 + row - column,
    column].
    """

    def __init__(self, kappa=None, tau=0.01, inlet=lambda t: 10.0 + 3.0 * math.sin(10.0 * math.pi * t), N=100):
        E = 1e4 if kappa is None else 2.0 / math.sqrt(math.pi) * (10.0 * kappa) ** 2
        self.N, self.tau, self.dx, self.inlet = N, tau, 10.0 / N, inlet
        self.c2 = 0.5 * E * math.sqrt(math.pi)
        self.t = tau
        self.a0 = np.ones(N + 1)
        self.v0 = np.full(N + 1, 10.0)
        self.p0 = np.zeros(N + 1)
        self.v, self.p = self.v0, self.p0

    @property
    def x0(self):
        return self.a0

    @property
    def parallel_x0(self):
        return np.concatenate((self.a0, self.p0))

    @property
    def fields(self):
        return {"area": slice(0, self.N + 1), "pressure": slice(self.N + 1, 2 * self.N + 2)}

    def wall(self, p):
        return (2.0 * self.c2 / (p - 2.0 * self.c2)) ** 2

    def G(self, a):
        return self.wall(self.flow(a))

    def parallel_G(self, x):
        a, p = x[: self.N + 1], x[self.N + 1 :]
        return np.concatenate((self.wall(p), self.flow(a)))

    def flow(self, a):
        """Pressures (N+1,) for given areas: Newton on the discrete continuity and momentum equations."""
        v, p = self.v.copy(), self.p.copy()
        for _ in range(NEWTON_ITERATIONS):
            if not (np.isfinite(v[-1]) and self.p0[-1] < 2.0 * self.c2 and np.abs(p).max() < 1e3 * self.c2):
                return np.full(self.N + 1, np.nan)
            F, J = self.flow_residual(a, v, p)
            d = _correction(4, J, F)
            v, p = v + d[0::2], p + d[1::2]
            # far below the tightest interface tolerance used (1e-6 of the first residual)
            if np.linalg.norm(d) <= 1e-12 * math.sqrt(d.size) * (1.0 + np.abs(p).max()):
                break
        self.v, self.p = v, p
        return p

    def flow_residual(self, a, v, p):
        """Continuity and momentum at every node, interleaved (2N+2,), and their Jacobian in band storage (9, 2N+2)."""
        N, k = self.N, self.dx / self.tau
        n = 2 * N + 2
        Ap = 0.25 * (a[1:-1] + a[2:])
        Am = 0.25 * (a[1:-1] + a[:-2])
        da = 0.25 * (a[2:] - a[:-2])
        vm, vi, vp = v[:-2], v[1:-1], v[2:]
        pm, pi, pp = p[:-2], p[1:-1], p[2:]
        F = np.zeros(n)
        J = np.zeros((9, n))
        # rows 2i (continuity) and 2i+1 (momentum) of i = 1..N-1; columns 2i-2.. (i-1), 2i.. (i), 2i+2.. (i+1)
        F[2:-2:2] = k * (a[1:-1] - self.a0[1:-1]) + Ap * vp + da * vi - Am * vm
        J[6, 0:-4:2], J[4, 2:-2:2], J[2, 4::2] = -Am, da, Ap
        F[3:-2:2] = (
            k * (vi * a[1:-1] - self.v0[1:-1] * self.a0[1:-1])
            + Ap * (vi * vp + vi**2)
            - Am * (vm * vi + vm**2)
            + (Ap * pp - da * pi - Am * pm)
        )
        J[7, 0:-4:2] = -Am * (vi + 2.0 * vm)
        J[5, 2:-2:2] = k * a[1:-1] + Ap * (vp + 2.0 * vi) - Am * vm
        J[3, 4::2] = Ap * vi
        J[6, 1:-4:2], J[4, 3:-2:2], J[2, 5::2] = -Am, -da, Ap
        F[0], J[4, 0] = v[0] - self.inlet(self.t), 1.0
        F[1] = p[0] - 2.0 * p[1] + p[2]
        J[4, 1], J[2, 3], J[0, 5] = 1.0, -2.0, 1.0
        F[n - 2] = v[N] - 2.0 * v[N - 1] + v[N - 2]
        J[4, n - 2], J[6, n - 4], J[8, n - 6] = 1.0, -2.0, 1.0
        root = math.sqrt(self.c2 - 0.5 * self.p0[N]) - 0.25 * (v[N] - self.v0[N])
        F[n - 1] = p[N] - 2.0 * (self.c2 - root**2)
        J[4, n - 1], J[5, n - 2] = 1.0, -root
        return F, J

    def advance(self, x):
        self.a0, self.v0, self.p0 = x[: self.N + 1], self.v, self.p
        self.t += self.tau


class RingWallTube:
    """Pressure pulse in a tube whose wall is made of rings; G maps radii -> pressures -> radii, cell values (m,).

    Wall: rho_s h r_tt + b1 r_zzzz - b2 r_zz + b3 (r - r0) = p, b1 = E h^3 / (12 (1 - nu^2)), b2 = 2 nu b1 / r0^2,
    b3 = E h / ((1 - nu^2) r0^2); simply supported, r = r0 and r_zz = 0 at both ends; second differences. Flow:
    a_t + (a v)_z = 0, (a v)_t + (a v^2)_z + a p_z / rho_f = 0, that is (a p)_z - p a_z in conservation form; staggered
    finite volumes, p in the cells and v on the faces, momentum flux first-order upwind. Both backward Euler. The inlet
    pressure is `pulse` [Pa] for 3 ms, then 0; that of the outlet 0. (Degroote, Bruggeman, Haelterman & Vierendeels
    2008; wall of Quarteroni, Tuveri & Veneziani 2000)
    """

    E, nu, h, r0, rho_s, rho_f, duration = 3e5, 0.3, 1e-3, 5e-3, 1200.0, 1000.0, 3e-3

    def __init__(self, l=0.05, m=100, dt=1e-4, pulse=1333.2):
        self.l, self.m, self.dz, self.dt, self.pulse = l, m, l / m, dt, pulse
        plate = 1.0 / (1.0 - self.nu**2)
        self.b1 = self.E * self.h**3 / 12.0 * plate
        self.b2 = 2.0 * self.nu * self.b1 / self.r0**2
        self.b3 = self.E * self.h * plate / self.r0**2
        self.inertia = self.rho_s * self.h / dt**2
        K = np.zeros((3, m))  # upper bands of inertia + b3 + b2 T + b1 T^2, T = -d^2/dz^2 odd about both ends
        T = np.full(m, 2.0)
        T[[0, -1]] = 3.0
        square = T**2 + 2.0
        square[[0, -1]] -= 1.0
        bend, tension = self.b1 / self.dz**4, self.b2 / self.dz**2
        K[2] = self.inertia + self.b3 + tension * T + bend * square
        K[1, 1:] = -tension - bend * (T[1:] + T[:-1])
        K[0, 2:] = bend
        self._wall = (cholesky_banded(K), False)
        self.t = dt
        self.r1 = self.r2 = np.full(m, self.r0)  # radii of the last two steps
        self.v0 = np.zeros(m + 1)
        self.v, self.p = self.v0, np.zeros(m)

    @property
    def x0(self):
        return self.r1

    @property
    def wave_speed(self):
        """Moens-Korteweg speed of long waves, sqrt(b3 r0 / (2 rho_f)) = sqrt(E h / (2 rho_f r0 (1 - nu^2))), m/s."""
        return math.sqrt(0.5 * self.b3 * self.r0 / self.rho_f)

    @property
    def inlet(self):
        """Inlet pressure, Pa; the tolerance is for times that are sums of steps."""
        return self.pulse if self.t < self.duration + 0.5 * self.dt else 0.0

    def volume(self, r):
        """Volume of the tube with radii r, m^3."""
        return float(np.sum(np.pi * r**2)) * self.dz

    def outflow(self, r):
        """Volume flow out at the outlet and in at the inlet at the last evaluation, m^3/s."""
        return np.pi * r[-1] ** 2 * self.v[-1], np.pi * r[0] ** 2 * self.v[0]

    def G(self, r):
        return self.wall(self.flow(r))

    def wall(self, p):
        """Radii (m,) under the pressures p (m,)."""
        load = p + self.inertia * (2.0 * (self.r1 - self.r0) - (self.r2 - self.r0))
        return self.r0 + cho_solve_banded(self._wall, load, check_finite=False)

    def flow(self, r):
        """Pressures (m,) for given radii: Newton on the discrete continuity and momentum equations."""
        if not (np.all(np.isfinite(r)) and r.min() > 0.0):
            return np.full(self.m, np.nan)
        areas = [_on_faces(np.pi * radii**2) for radii in (r, self.r1)]
        growth = np.pi * (r**2 - self.r1**2)
        v, p = self.v.copy(), self.p.copy()
        for _ in range(NEWTON_ITERATIONS):
            F, J = self.flow_residual(growth, *areas, v, p)
            d = _correction(2, J, F)
            v, p = v + d[0::2], p + d[1::2]
            # near rounding of the wave speed, and far below the tightest interface tolerance used, 1e-8
            if not np.abs(d[0::2]).max() > 1e-12 * self.wave_speed:
                break
        if not np.all(np.isfinite(p)):
            return np.full(self.m, np.nan)
        self.v, self.p = v, p
        return p

    def flow_residual(self, growth, A, A1, v, p):
        """Momentum of faces and continuity of cells, interleaved v_0, p_0, v_1, ..., (2m+1,), and its bands (5, 2m+1).

        `growth` (m,) is a - a of the last step, A and A1 (m+1,) areas of faces now and then, m^2. Every equation is
        divided by an area or a step so that rows are of like size: momentum m/s, continuity m/s.
        """
        m, k = self.m, self.dz / self.dt
        ends = np.ones(m + 1)
        ends[[0, -1]] = 0.5  # the first and the last momentum cells are halves
        n = 2 * m + 1
        F = np.zeros(n)
        J = np.zeros((5, n))
        Q = A * v
        scale = 1.0 / (k * A)
        F[1::2] = (k * growth + Q[1:] - Q[:-1]) / A[1:]
        J[3, 0:-2:2], J[1, 2::2] = -A[:-1] / A[1:], 1.0
        # flux of momentum through the cells: mean flow times the upwind velocity
        mean = 0.5 * (Q[:-1] + Q[1:])
        forward = mean >= 0.0
        upwind = np.where(forward, v[:-1], v[1:])
        flux = mean * upwind
        by_left = 0.5 * A[:-1] * upwind + mean * forward
        by_right = 0.5 * A[1:] * upwind + mean * ~forward
        through = np.concatenate(([Q[0] * v[0]], flux, [Q[-1] * v[-1]]))
        pressure = np.concatenate(([self.inlet], p, [0.0])) / self.rho_f
        F[0::2] = scale * (k * ends * (Q - A1 * self.v0) + np.diff(through) + A * np.diff(pressure))
        own = k * ends * A
        own[:-1] += by_left
        own[1:] -= by_right
        own[0] -= 2.0 * Q[0]
        own[-1] += 2.0 * Q[-1]
        J[2, 0::2] = scale * own
        J[0, 2::2] = scale[:-1] * by_right
        J[4, 0:-2:2] = -scale[1:] * by_left
        J[1, 1::2] = scale[:-1] * A[:-1] / self.rho_f
        J[3, 1::2] = -scale[1:] * A[1:] / self.rho_f
        return F, J

    def advance(self, x):
        self.r2, self.r1, self.v0 = self.r1, x, self.v
        self.t += self.dt


def _correction(width, J, F):
    """-J^-1 F of a banded J; nan where it is singular, which ends the coupling loop as diverged."""
    try:
        return solve_banded((width, width), J, -F, overwrite_ab=True, overwrite_b=True, check_finite=False)
    except np.linalg.LinAlgError:
        return np.full_like(F, np.nan)


def _on_faces(a):
    """Means of neighbours, and the end values at the ends: (m,) -> (m+1,)."""
    return np.concatenate((a[:1], 0.5 * (a[:-1] + a[1:]), a[-1:]))
