"""Eigenvalues of G' at a fixed point of x = G(x), from finite differences of G alone.

G'u is taken from central differences, (G(x + h u) - G(x - h u)) / 2h with |u|_2 = 1, two evaluations of G each.
`step` is h, in the unit of x; the default 1e-3 |x|_2 keeps solver noise of 1e-7 |x|_2 at 1e-4 in an eigenvalue, and the
truncation error is of order h^2. `start` is the first vector of the iteration, of the shape of x: where G keeps a
symmetry, one that has it confines the search to it (not in the full Jacobian of up to five unknowns).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Map = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Eigenvalue:
    """An eigenvalue of G' [1] and its mode.

    `value` is its real part, `imaginary` the magnitude of the other; `vector` has the shape of x and |vector|_2 = 1
    (the real part of the mode where it is complex). `evaluations` counts calls of G, `settled` says whether the
    accuracy asked for was reached, `message` why not. `ritz_values` are the eigenvalues of G' on the searched subspace.
    """

    value: float
    imaginary: float
    vector: np.ndarray
    evaluations: int
    settled: bool
    message: str
    ritz_values: np.ndarray


def dominant_eigenvalue(
    G: Map,
    x: np.ndarray,
    step: float | None = None,
    tol: float = 1e-3,
    max_evaluations: int = 100,
    start: np.ndarray | None = None,
) -> Eigenvalue:
    """Eigenvalue of G' of largest magnitude, signed, by power iteration: lambda = u.G'u, u <- G'u / |G'u|.

    Settled means |G'u - lambda u| <= tol |lambda|. That never happens for a complex pair or for two eigenvalues of
    (nearly) equal magnitude; `settled` is False then and `value` is the last Rayleigh quotient.
    """
    product = _Product(G, x, step, max_evaluations)
    u = _start(product.x.size, start)
    value, message, settled = 0.0, "", False
    while product.evaluations + 2 <= max_evaluations:
        w = product(u)
        if not np.all(np.isfinite(w)):
            return product.failed(u)
        value, size = float(u @ w), float(np.linalg.norm(w))
        if size <= product.floor:
            value, settled = 0.0, True
            break
        if np.linalg.norm(w - value * u) <= tol * abs(value):
            settled = True
            break
        u = w / size
    if not settled:
        message = (
            f"Power iteration did not settle in {product.evaluations} evaluations of G: "
            "a complex pair or eigenvalues of nearly equal magnitude."
        )
    return product.result(complex(value), u, settled, message, np.array([value]))


def rightmost_eigenvalue(
    G: Map,
    x: np.ndarray,
    step: float | None = None,
    tol: float = 5e-4,
    max_evaluations: int = 40,
    start: np.ndarray | None = None,
) -> Eigenvalue:
    """Eigenvalue of G' of largest real part, by Arnoldi iteration; up to five unknowns by the full Jacobian.

    A real one above 1 is a statically unstable equilibrium: G' = K^-1 dF/dx, and the coupled tangent K - dF/dx changes
    sign where it passes 1. Settled means that the residual |G'u - lambda u| of the Ritz pair is below
    a = tol max(1, |lambda|), or below 20 a while the last three values agree to a / 5: the error of the value is
    usually far below the residual.
    """
    product = _Product(G, x, step, max_evaluations)
    n = product.x.size
    if n <= 5:
        columns = np.array([product(u) for u in np.eye(n)]).T
        if not np.all(np.isfinite(columns)):
            return product.failed(_start(n))
        values, vectors = np.linalg.eig(columns)
        j = int(np.argmax(values.real))
        return product.result(values[j], vectors[:, j], True, "", values)

    steps = min(n, max_evaluations // 2)
    Q, H = np.zeros((steps + 1, n)), np.zeros((steps + 1, steps))
    Q[0] = _start(n, start)
    history: list[complex] = []
    settled = False
    for k in range(steps):
        w = product(Q[k])
        if not np.all(np.isfinite(w)):
            return product.failed(Q[0])
        size = np.linalg.norm(w)
        for _ in range(2):  # twice is enough for orthogonality to rounding
            h = Q[: k + 1] @ w
            w -= h @ Q[: k + 1]
            H[: k + 1, k] += h
        H[k + 1, k] = np.linalg.norm(w)
        values, vectors = np.linalg.eig(H[: k + 1, : k + 1])
        j = int(np.argmax(values.real))
        history.append(complex(values[j]))
        # 1e-6: what is left of G'q is rounding and noise of the differences, the subspace is invariant
        invariant = k + 1 == n or H[k + 1, k] <= max(1e-6 * size, product.floor)
        accuracy = tol * max(1.0, abs(values[j]))
        residual = H[k + 1, k] * abs(vectors[-1, j])
        steady = len(history) > 3 and all(abs(old - history[-1]) <= 0.2 * accuracy for old in history[-3:-1])
        if invariant or residual <= accuracy or (steady and residual <= 20.0 * accuracy):
            settled = True
            break
        Q[k + 1] = w / H[k + 1, k]
    message = "" if settled else f"The Arnoldi iteration did not settle in {product.evaluations} evaluations of G."
    return product.result(history[-1], vectors[:, j] @ Q[: len(history)], settled, message, values)


def critical_relaxation(eigenvalue: float) -> float:
    """Bound on a constant relaxation factor, 2 / (1 - lambda) [1]: it converges for 0 < omega < bound.

    The error contracts by |1 - omega (1 - lambda)|. `eigenvalue` is the leftmost (most negative) one of a real
    spectrum: the dominant one, unless that is positive. An eigenvalue >= 1 leaves no stable factor: 0.
    """
    if not np.isfinite(eigenvalue):
        raise ValueError(f"The eigenvalue must be finite, got {eigenvalue}.")
    return 2.0 / (1.0 - eigenvalue) if eigenvalue < 1.0 else 0.0


class _Product:
    """u -> G'(x) u, counting evaluations of G."""

    def __init__(self, G: Map, x: np.ndarray, step: float | None, max_evaluations: int):
        self.G, self.shape = G, np.shape(x)
        self.x = np.array(x, dtype=float).ravel()
        if self.x.size == 0 or not np.all(np.isfinite(self.x)):
            raise ValueError("x must have at least one entry and all its entries must be finite.")
        if max_evaluations < 2:
            raise ValueError(f"max_evaluations must be at least 2, got {max_evaluations}.")
        size = float(np.linalg.norm(self.x))
        self.h = 1e-3 * (size or 1.0) if step is None else float(step)
        if not (np.isfinite(self.h) and self.h > 0.0):
            raise ValueError(f"step must be positive and finite, got {step}.")
        self.floor = 1e2 * np.finfo(float).eps * max(1.0, size / self.h)  # rounding in G'u
        self.evaluations = 0

    def __call__(self, u: np.ndarray) -> np.ndarray:
        self.evaluations += 2
        forward, backward = (
            np.array(self.G((self.x + s * self.h * u).reshape(self.shape)), dtype=float).ravel() for s in (1.0, -1.0)
        )
        with np.errstate(all="ignore"):
            return (forward - backward) / (2.0 * self.h)

    def result(self, value: complex, vector: np.ndarray, settled: bool, message: str, ritz: np.ndarray) -> Eigenvalue:
        turned = vector * np.exp(-1j * np.angle(vector[np.argmax(np.abs(vector))]))  # largest entry real, positive
        mode = turned.real / np.linalg.norm(turned.real)
        value = complex(value)
        return Eigenvalue(
            value.real, abs(value.imag), mode.reshape(self.shape), self.evaluations, settled, message, np.array(ritz)
        )

    def failed(self, u: np.ndarray) -> Eigenvalue:
        return self.result(complex(np.nan), u, False, "G returned values that are not finite.", np.array([]))


def _start(n: int, given: np.ndarray | None = None) -> np.ndarray:
    """The given start vector normalised, or a fixed one without symmetries that has a part in every mode, (n,)."""
    u = np.random.default_rng(0).standard_normal(n) if given is None else np.array(given, dtype=float).ravel()
    if u.size != n or not np.all(np.isfinite(u)) or not np.any(u):
        raise ValueError("start must have the shape of x, be finite and not be zero.")
    return u / np.linalg.norm(u)
