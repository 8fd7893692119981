"""Cantilevers of any size under a dead load across their tip, and where their tips belong: Euler's elastica, by
quadrature of its differential equation. It shares no code with the solvers, which it is to judge.
"""

from dataclasses import dataclass

import numpy as np

# Steps of the integration along the beam, by the classical Runge-Kutta method, and Newton iterations on its root.
STEPS, SECANTS = 400, 12


@dataclass(frozen=True)
class Cantilever:
    """A beam of `length` m and bending stiffness `EI` N m^2 in `elements`, with the tip load `P` N; `axis` (3,) is its
    direction, `across` (3,) that of the load.
    """

    length: float
    EI: float
    P: float
    elements: int
    axis: np.ndarray
    across: np.ndarray


def cantilever(seed):
    """A random one, of 1 to 1e4 m, 1e-1 to 1e9 N m^2, with P l^2 / EI of 1e-3 to 10."""
    rng = np.random.default_rng([99, seed])
    length, stiffness = 10.0 ** rng.uniform(0.0, 4.0), 10.0 ** rng.uniform(-1.0, 9.0)
    q, _ = np.linalg.qr(rng.normal(size=(3, 2)))
    load = 10.0 ** rng.uniform(-3.0, 1.0) * stiffness / length**2
    return Cantilever(length, stiffness, load, int(rng.integers(20, 101)), q[:, 0], q[:, 1])


def _bent(curvature, load):
    """Slope and curvature at the tip, and its place along and across, of a beam of length 1 and EI = 1 with a curvature
    at its root: theta'' = -P cos theta.
    """

    def rate(y):
        return np.array([y[1], -load * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    y, h = np.array([0.0, curvature, 0.0, 0.0]), 1.0 / STEPS
    for _ in range(STEPS):
        a = rate(y)
        b = rate(y + 0.5 * h * a)
        c = rate(y + 0.5 * h * b)
        y = y + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(y + h * c))
    return y


def tip(beam):
    """Place (3,) m of the tip from the root, to some 1e-9 of the length: the tip has no curvature."""
    load = beam.P * beam.length**2 / beam.EI
    root = load  # of a beam that hardly bends
    for _ in range(SECANTS):
        h = 1e-6 * load
        wrong, slope = _bent(root, load)[1], (_bent(root + h, load)[1] - _bent(root - h, load)[1]) / (2.0 * h)
        root -= wrong / slope
    found = _bent(root, load)
    return beam.length * (found[2] * beam.axis + found[3] * beam.across)
