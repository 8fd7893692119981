"""Random coupled problems with a unique fixed point, made to be hard for a scheme without tuning; seed -> problem.

G(x) = x* + S P Lambda phi(P^-1 S^-1 (x - x*)) + noise with P = H (I + N) of random reflections H and a shear N that
couples the modes one way, and S the scales of the fields. Lambda has at most 30 eigenvalues beyond the radius 0.3, up
to 50 in magnitude, of either sign or in complex pairs, none within 0.1 of 1; all others lie within 0.3.
"""

from itertools import pairwise

import numpy as np

OUTSIDE, RADIUS, LARGEST, NEAR_ONE = 30, 0.3, 50.0, 0.1
REFLECTIONS = 3
NOISE = 0.01  # most noise of a field, in parts of its tolerance


class RandomProblem:
    """One problem: `x0`, `G`, `fields`, and `options` of `fixed_point`; `x_star` is the solution."""

    def __init__(self, seed: int):
        rng = np.random.default_rng(seed)
        self.n = n = int(np.exp(rng.uniform(0.0, np.log(2000.999))))
        self.linear = bool(rng.random() < 0.4)
        self.bend = 0.0 if self.linear else 10.0 ** rng.uniform(-2.0, -0.3)
        self.outside = int(rng.integers(0, min(OUTSIDE, n) + 1))
        self._modes(rng)
        self._basis(rng)
        self._scales(rng)
        self._tolerances(rng)
        self.x_star = self.scale * rng.standard_normal(n) * 10.0 ** rng.uniform(-1.0, 1.0)
        start = rng.standard_normal(n) * 10.0 ** rng.uniform(-2.0, 0.5)
        self.x0 = self.x_star + self.scale * self._turned(start)
        self.rng = rng

    def _modes(self, rng):
        """Eigenvalues, and which neighbours form complex pairs."""
        n, m = self.n, self.outside
        magnitude = np.exp(rng.uniform(np.log(RADIUS), np.log(LARGEST), m))
        sign = np.where(rng.random(m) < rng.choice([0.0, 0.2, 0.5]), 1.0, -1.0)
        outer = sign * magnitude
        outer = np.where(np.abs(outer - 1.0) < NEAR_ONE, -outer, outer)
        inner = RADIUS * rng.uniform(-1.0, 1.0, n - m) * rng.choice([1.0, 0.9, 0.5]) ** np.arange(n - m)
        self.eigenvalues = np.concatenate((outer, inner))
        self.angles = np.zeros(m // 2)
        if rng.random() < 0.25:
            pairs = m // 2
            turned = rng.random(pairs) < 0.5
            first = np.abs(outer[0 : 2 * pairs : 2])
            angle = np.where(turned, rng.uniform(0.6, np.pi - 0.1, pairs), 0.0)
            self.angles = angle
            for i in np.flatnonzero(turned):
                self.eigenvalues[2 * i : 2 * i + 2] = first[i]
        self.grows = self.eigenvalues > 0.9

    def _basis(self, rng):
        u = rng.standard_normal((REFLECTIONS, self.n))
        self.u = u / np.linalg.norm(u, axis=1, keepdims=True)
        m = self.outside
        strength = rng.choice([0.0, 0.3, 1.0])
        self.shear = np.triu(rng.standard_normal((m, m)), 1) * strength / max(np.sqrt(m), 1.0)

    def _scales(self, rng):
        parts = int(rng.integers(1, min(4, self.n) + 1))
        cuts = np.sort(rng.choice(np.arange(1, self.n), parts - 1, replace=False)) if parts > 1 else []
        edges = [0, *map(int, cuts), self.n]
        self.fields = {f"field {i}": slice(a, b) for i, (a, b) in enumerate(pairwise(edges))}
        spread = rng.choice([0.0, 6.0, 12.0])
        self.scale = np.empty(self.n)
        for f in self.fields.values():
            self.scale[f] = 10.0 ** rng.uniform(-0.5 * spread, 0.5 * spread)

    def _tolerances(self, rng):
        self.kind = str(rng.choice(["rtol", "residual_rtol"]))
        self.tolerance = 10.0 ** rng.uniform(-8.0, -3.0)
        self.noise = NOISE * self.tolerance * rng.choice([0.0, 0.1, 1.0])
        self.options = {self.kind: self.tolerance, "fields": self.fields, "max_iterations": 200}
        self.first = None  # |r_1| of each field

    def _turned(self, y):
        y = y.copy()
        m = self.outside
        y[:m] += self.shear @ y[:m]
        for u in self.u:
            y -= 2.0 * u * (u @ y)
        return y

    def _turned_back(self, y):
        y = y.copy()
        for u in self.u[::-1]:
            y -= 2.0 * u * (u @ y)
        m = self.outside
        y[:m] = np.linalg.solve(np.eye(m) + self.shear, y[:m])
        return y

    def _phi(self, y):
        """An increasing function with phi(0) = 0, phi'(0) = 1: flatter where lambda < 1, steeper where it is above."""
        a = self.bend
        if not a:
            return y
        return np.where(self.grows, y * (1.0 + a * np.abs(y) / (1.0 + np.abs(y))), np.tanh(a * y) / a)

    def G(self, x):
        """The coupled map with its noise."""
        y = self._phi(self._turned_back((x - self.x_star) / self.scale)) * self.eigenvalues
        if self.angles.any():
            a, b = y[0 : 2 * len(self.angles) : 2].copy(), y[1 : 2 * len(self.angles) : 2].copy()
            c, s = np.cos(self.angles), np.sin(self.angles)
            y[0 : 2 * len(self.angles) : 2], y[1 : 2 * len(self.angles) : 2] = c * a - s * b, s * a + c * b
        x_tilde = self.x_star + self.scale * self._turned(y)
        if self.noise:
            r = x_tilde - x
            if self.first is None:
                self.first = [np.linalg.norm(r[f]) for f in self.fields.values()]
            for f, first in zip(self.fields.values(), self.first, strict=True):
                reference = first if self.kind == "residual_rtol" else np.linalg.norm(x_tilde[f])
                size = f.stop - f.start
                x_tilde[f] += self.noise * reference * self.rng.standard_normal(size) / np.sqrt(size)
        return x_tilde
