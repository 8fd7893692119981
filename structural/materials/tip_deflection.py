"""The LEI thesis' own law of inflated beams, kept for comparison: it depends on how a tube is divided.

Every element takes the secant stiffness that a cantilever of 1 m has at the element's own tip deflection divided by its
length (thesis eqs. 5.30, 5.32, 5.34), so that short elements stay at the stiffness of small loads.
"""

from dataclasses import dataclass

import numpy as np

from .sections import Section, coupled, shortening
from .tubes import TUBE_CRITERIA, judged_tubes, largest_moments


@dataclass(frozen=True, eq=False)
class TipDeflectionSection(Section):
    """Secant law EI = P / (3 (v - P / kGA)) from P = A (1 - exp(-B v / A)), torque as in `TubeSection`; arrays (e,)."""

    EA: np.ndarray
    kGA: np.ndarray
    peak: np.ndarray
    rate: np.ndarray
    A: np.ndarray
    B: np.ndarray
    collapse: np.ndarray  # N m
    radius: np.ndarray  # m
    wrinkling: np.ndarray  # N m

    def _secant(self, v):
        """EI (e,) N m^2 and its slope over the deflection v (e,) of a beam of 1 m."""
        load = -self.A * np.expm1(-self.B * v / self.A)
        slope = self.B * np.exp(-self.B * v / self.A)
        bent = v - load / self.kGA
        small = v < 1e-6
        safe = np.where(small, 1.0, bent)
        left = 1.0 - self.B / self.kGA
        initial = self.B / (3.0 * left), -self.B * self.B / (6.0 * self.A * left * left)
        ei = np.where(small, initial[0] + initial[1] * v, load / (3.0 * safe))
        return ei, np.where(small, initial[1], (slope * v - load) / (3.0 * safe * safe))

    @property
    def initial_bending(self):
        """EI (e,) N m^2 of the tube without load."""
        return self._secant(np.zeros_like(self.A))[0]

    def response(self, natural, l0):
        """Forces (e,6) and tangents (e,6,6); the law has no energy, so the tangent is not symmetric."""
        first = natural[:, 1:3]
        v = np.sqrt(np.einsum("ek,ek->e", first, first))
        ei, ei_slope = self._secant(v)
        shear = 12.0 * ei / (self.kGA * l0 * l0)
        q = shortening(np.repeat(1.0 / (1.0 + shear)[:, None] ** 2, 2, axis=1))

        def ends(odd, even):
            return np.concatenate([odd - even, odd + even], axis=1)

        def bending(theta):
            a, s = 0.5 * (theta[:, 2:] - theta[:, :2]), 0.5 * (theta[:, 2:] + theta[:, :2])
            soft = 1.0 + shear
            even, odd = 2.0 * ei / l0, 6.0 * ei / (l0 * soft)
            moment = np.concatenate(
                [odd[:, None] * s - even[:, None] * a, odd[:, None] * s + even[:, None] * a], axis=1
            )
            k = np.zeros((len(l0), 4, 4))
            near, far = 0.5 * (odd + even), 0.5 * (odd - even)
            for i, j in ((0, 2), (1, 3)):
                k[:, i, i] = k[:, j, j] = near
                k[:, i, j] = k[:, j, i] = far
            by_even, by_odd = 2.0 / l0, 6.0 / (l0 * soft * soft)
            by_ei = np.concatenate(
                [by_odd[:, None] * s - by_even[:, None] * a, by_odd[:, None] * s + by_even[:, None] * a], axis=1
            )
            along = first / np.where(v > 0.0, v, 1.0)[:, None]
            k[:, :, :2] += (ei_slope[:, None] * by_ei)[:, :, None] * along[:, None, :]
            return moment, k

        def torsion(psi):
            turn = self.rate * psi / l0
            return self.peak * np.arctan(turn), self.peak * self.rate / l0 / (1.0 + turn * turn)

        return coupled(natural, l0, q, lambda d: (self.EA / l0 * d, self.EA / l0), bending, torsion)

    def utilisation(self, force):
        """Largest bending moment of each element relative to its collapse moment (e,), from section forces (e,6)."""
        return largest_moments(force) / self.collapse

    @property
    def criteria(self):
        """See Section."""
        return TUBE_CRITERIA

    def judged(self, force, natural, l0):
        """See Section."""
        return judged_tubes(self, force, natural, l0)


def tip_deflection_tube(tube):
    """The thesis' law for the fits behind a section made by `breukels_tube`."""
    law = tube.bending
    fits = law.scale * law.A, law.scale * law.B, law.collapse
    return TipDeflectionSection(tube.EA, tube.kGA, tube.peak, tube.rate, *fits, tube.radius, tube.wrinkling)
