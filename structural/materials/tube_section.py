"""The section of an inflated tube: end moments from the flexibility of the element, for any bending law."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .sections import Section, coupled, linear_shear, shortening

# Beyond collapse the tangent stiffness is this part of the initial EI (or what the law has left, if less). No source
# measures it; it keeps the tangent regular and the moment rising, so that a collapsed tube can be solved.
AFTER_COLLAPSE = 0.02
# Gauss-Lobatto points for the flexibility of a tube: its curvature grows steeply towards the loaded end.
_POINTS = 9
# Newton iterations for the end moments, and the relative change that ends them.
_MOST, _CLOSE = 60, 1e-12


def _lobatto(count):
    inner = np.polynomial.legendre.Legendre.basis(count - 1).deriv().roots()
    x = np.concatenate([[-1.0], np.sort(inner.real), [1.0]])
    w = 2.0 / (count * (count - 1) * np.polynomial.legendre.Legendre.basis(count - 1)(x) ** 2)
    return 0.5 * (1.0 + x), 0.5 * w


_XI, _WEIGHT = _lobatto(_POINTS)


@dataclass(frozen=True, eq=False)
class TubeSection(Section):
    """Section of inflated tubes, arrays (e,): shear `kGA` N, `EA` N, torque T = peak atan(rate phi').

    The `bending` law has `bend` (curvature and slope over moment) and a `collapse` moment, see `tubes`.

    Its end moments follow from the rotations by the flexibility of the element, theta_1 = -int (1 - xi) kappa l0 dxi
    and theta_2 = int xi kappa l0 dxi (plus shear) with the linear moment M = -(1 - xi) m_1 + xi m_2: exact for one
    element whatever the law, if the moment is linear.
    """

    EA: np.ndarray
    kGA: np.ndarray
    peak: np.ndarray  # N m
    rate: np.ndarray  # m
    bending: Any

    def response(self, natural, l0):
        """Forces (e,6) and tangents (e,6,6) at the natural deformations (e,6)."""
        stiffness = self.initial_bending
        shear = 12.0 * stiffness / (self.kGA * l0 * l0)
        q = shortening(np.repeat(1.0 / (1.0 + shear)[:, None] ** 2, 2, axis=1))

        def torsion(psi):
            turn = self.rate * psi / l0
            return self.peak * np.arctan(turn), self.peak * self.rate / l0 / (1.0 + turn * turn)

        return coupled(
            natural,
            l0,
            q,
            lambda delta: (self.EA / l0 * delta, self.EA / l0),
            lambda theta: self._end_moments(theta, l0, stiffness, shear),
            torsion,
        )

    @cached_property
    def initial_bending(self):
        """EI (e,) N m^2 of the tube without load."""
        return 1.0 / self.bending.bend(np.zeros((len(self.EA), 1)))[1][:, 0]

    @cached_property
    def _beyond(self):
        """Slope (e,1) of curvature over moment beyond collapse."""
        slope = self.bending.bend(self.bending.collapse[:, None])[1]
        return np.maximum(slope, 1.0 / (AFTER_COLLAPSE * self.initial_bending[:, None]))

    def _curvature(self, m):
        """Vectors of curvature (e,g,2) and their derivative (e,g,2,2) with respect to moments m (e,g,2)."""
        size = np.sqrt(np.einsum("egk,egk->eg", m, m))
        end = self.bending.collapse[:, None]
        kappa, slope = self.bending.bend(np.minimum(size, end))
        after = self._beyond
        beyond = size > end
        kappa = np.where(beyond, kappa + after * (size - end), kappa)
        slope = np.where(beyond, after, slope)
        small = size < 1e-12 * end
        secant = np.where(small, slope, kappa / np.where(small, 1.0, size))
        unit = m / np.where(small, 1.0, size)[..., None]
        c = secant[..., None, None] * np.eye(2)
        c = c + (slope - secant)[..., None, None] * (unit[..., :, None] * unit[..., None, :])
        return secant[..., None] * m, c

    def _rotations(self, ends, l0):
        """Rotations (e,4) of the ends under end moments (e,2,2: end, axis), and their derivative (e,4,4)."""
        shape = np.stack([_XI - 1.0, _XI])  # moment at the points from either end
        kappa, c = self._curvature(np.einsum("ig,eik->egk", shape, ends))
        weighted = shape * _WEIGHT
        theta = l0[:, None, None] * np.einsum("ig,egk->eik", weighted, kappa)
        flexibility = l0[:, None, None, None, None] * np.einsum("ig,jg,egkl->eikjl", weighted, shape, c)
        slide = (1.0 / (self.kGA * l0))[:, None, None]
        theta = theta + slide * ends.sum(axis=1)[:, None]
        flexibility += slide[..., None, None] * np.eye(2)[:, None, :]
        return theta.reshape(-1, 4), flexibility.reshape(-1, 4, 4)

    def _end_moments(self, theta, l0, stiffness, shear):
        """End moments (e,4) and tangent (e,4,4) at rotations (e,4): Newton on the flexibility.

        The flexibility is that of a convex complementary energy. From the moments of the initial stiffness, which are
        too large, Newton comes down on the solution; steps that do not lower the gap are shortened.
        """
        ends = linear_shear(theta, stiffness, l0, shear)
        found, flexibility = self._rotations(ends.reshape(-1, 2, 2), l0)
        scale = np.abs(theta).max(axis=1) + 1e-300
        gap = theta - found
        for _ in range(_MOST):
            off = np.abs(gap).max(axis=1) / scale
            if not np.any(off > _CLOSE):
                break
            step = np.linalg.solve(flexibility, gap[..., None])[..., 0]
            size = np.ones(len(l0))
            for _ in range(12):
                trial = ends + size[:, None] * step
                found, new = self._rotations(trial.reshape(-1, 2, 2), l0)
                worse = np.abs(theta - found).max(axis=1) / scale > np.maximum(off * (1.0 - 1e-4 * size), _CLOSE)
                if not worse.any():
                    break
                size = np.where(worse, 0.5 * size, size)
            ends, flexibility, gap = trial, new, theta - found
            if np.all(np.abs(step).max(axis=1) <= 1e-15 * (np.abs(ends).max(axis=1) + 1e-300)):
                break
        return ends, np.linalg.inv(flexibility)

    def fullness(self, force):
        """Largest bending moment of each element relative to its collapse moment (e,), from section forces (e,6)."""
        m = force[:, 1:5].reshape(-1, 2, 2)
        return np.sqrt(np.einsum("eik,eik->ei", m, m)).max(axis=1) / self.bending.collapse
