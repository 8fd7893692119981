"""Coupled reference problems in plain numpy: each offers x0, G(x) and, when it marches in time, advance(x)."""

import math

import numpy as np


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


class Tube:
    """Blood flow in a 1D elastic tube; G maps areas -> pressures -> areas (preCICE elastic-tube-1d, Degroote 2008).

    `kappa` selects E = 2 pi^(-1/2) (10 kappa)^2, else E = 1e4.
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
        size = 2 * (self.N + 1)
        for _ in range(30):
            if not (np.isfinite(v[-1]) and self.p0[-1] < 2.0 * self.c2 and np.abs(p).max() < 1e3 * self.c2):
                return np.full(self.N + 1, np.nan)
            F, J = self._flow_residual(a, v, p)
            d = np.linalg.solve(J, -F).reshape(2, -1)
            v, p = v + d[0], p + d[1]
            # far below the tightest interface tolerance used (1e-6 of the first residual)
            if np.linalg.norm(d) <= 1e-12 * math.sqrt(size) * (1.0 + np.abs(p).max()):
                break
        self.v, self.p = v, p
        return p

    def _flow_residual(self, a, v, p):
        N, k = self.N, self.dx / self.tau
        i = np.arange(1, N)
        Ap, Am = 0.25 * (a[i] + a[i + 1]), 0.25 * (a[i] + a[i - 1])
        da = 0.25 * (a[i + 1] - a[i - 1])
        F = np.zeros((2, N + 1))
        J = np.zeros((2, N + 1, 2, N + 1))
        F[0, i] = k * (a[i] - self.a0[i]) + Ap * v[i + 1] + da * v[i] - Am * v[i - 1]
        J[0, i, 0, i + 1], J[0, i, 0, i], J[0, i, 0, i - 1] = Ap, da, -Am
        F[1, i] = (
            k * (v[i] * a[i] - self.v0[i] * self.a0[i])
            + Ap * (v[i] * v[i + 1] + v[i] ** 2)
            - Am * (v[i - 1] * v[i] + v[i - 1] ** 2)
            + (Ap * p[i + 1] - da * p[i] - Am * p[i - 1])
        )
        J[1, i, 0, i + 1] = Ap * v[i]
        J[1, i, 0, i] = k * a[i] + Ap * (v[i + 1] + 2.0 * v[i]) - Am * v[i - 1]
        J[1, i, 0, i - 1] = -Am * (v[i] + 2.0 * v[i - 1])
        J[1, i, 1, i + 1], J[1, i, 1, i], J[1, i, 1, i - 1] = Ap, -da, -Am
        F[0, 0], J[0, 0, 0, 0] = v[0] - self.inlet(self.t), 1.0
        F[1, 0] = p[0] - 2.0 * p[1] + p[2]
        J[1, 0, 1, :3] = 1.0, -2.0, 1.0
        F[0, N] = v[N] - 2.0 * v[N - 1] + v[N - 2]
        J[0, N, 0, N - 2 :] = 1.0, -2.0, 1.0
        root = math.sqrt(self.c2 - 0.5 * self.p0[N]) - 0.25 * (v[N] - self.v0[N])
        F[1, N] = p[N] - 2.0 * (self.c2 - root**2)
        J[1, N, 1, N], J[1, N, 0, N] = 1.0, -root
        return F.ravel(), J.reshape(2 * N + 2, 2 * N + 2)

    def advance(self, x):
        self.a0, self.v0, self.p0 = x[: self.N + 1], self.v, self.p
        self.t += self.tau
