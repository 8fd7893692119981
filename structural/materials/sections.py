"""Section laws: axial force, end moments and torque of a beam from its natural deformations, with their tangent.

Shared by all laws, to second order in the rotations from the chord: a bent beam is longer than its chord,
delta = u + l0 sum over both planes of (theta_a^2 / 6 + mu theta_s^2 / 10), theta_a = (theta_2 - theta_1) / 2 and
theta_s = (theta_1 + theta_2) / 2, from the slopes of the cubic that a Timoshenko beam takes,
mu = 1 / (1 + 12 EI / (kGA l0^2))^2; and the twist of its axis adds to that of its ends,
psi = phi - (theta_n1 theta_b2 - theta_b1 theta_n2), because the tangent wanders off the shortest way between them.
"""

from dataclasses import Field, dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from interface.validity import Criterion

_PLANES = ((1, 3), (2, 4))  # rows of theta_1, theta_2 in the planes that bend about n and b
_TWIST = np.zeros((6, 6))
_TWIST[1, 4] = _TWIST[4, 1] = -1.0
_TWIST[2, 3] = _TWIST[3, 2] = 1.0


def shortening(mu):
    """Second derivatives (e,6,6) of (delta - u) / l0, from mu (e,2) of the two planes."""
    q = np.zeros((len(mu), 6, 6))
    for plane, (i, j) in enumerate(_PLANES):
        q[:, i, i] = q[:, j, j] = 1.0 / 12.0 + mu[:, plane] / 20.0
        q[:, i, j] = q[:, j, i] = -1.0 / 12.0 + mu[:, plane] / 20.0
    return q


def coupled(natural, l0, q, axial, bending, torsion):
    """Forces (e,6) and tangents (e,6,6) in the natural deformations.

    `axial` and `torsion` are functions of delta (e,) and psi (e,) that give force and slope, `bending` of
    theta (e,4) that gives moments (e,4) and tangent (e,4,4).
    """
    e = len(l0)
    q_theta = np.einsum("eij,ej->ei", q, natural)
    delta = natural[:, 0] + 0.5 * l0 * np.einsum("ei,ei->e", q_theta, natural)
    d_delta = l0[:, None] * q_theta
    d_delta[:, 0] += 1.0
    turn = natural @ _TWIST
    psi = natural[:, 5] + 0.5 * np.einsum("ei,ei->e", turn, natural)
    d_psi = turn.copy()
    d_psi[:, 5] += 1.0
    n, n_slope = axial(delta)
    t, t_slope = torsion(psi)
    m, m_slope = bending(natural[:, 1:5])
    force = n[:, None] * d_delta + t[:, None] * d_psi
    force[:, 1:5] += m
    tangent = n_slope[:, None, None] * (d_delta[:, :, None] * d_delta[:, None, :])
    tangent += t_slope[:, None, None] * (d_psi[:, :, None] * d_psi[:, None, :])
    tangent += (n * l0)[:, None, None] * q + t[:, None, None] * _TWIST
    tangent[:, 1:5, 1:5] += m_slope
    return force, tangent.reshape(e, 6, 6)


def linear_shear(theta, ei, l0, shear):
    """End moments (e,4) of isotropic Timoshenko beams at rotations (e,4): EI (e,) and 12 EI / (kGA l0^2) (e,)."""
    unit = ei / (l0 * (1.0 + shear))
    first, second = theta[:, :2], theta[:, 2:]
    near, far = (unit * (4.0 + shear))[:, None], (unit * (2.0 - shear))[:, None]
    return np.concatenate([near * first + far * second, far * first + near * second], axis=1)


class Section:
    """What all sections share: arrays (e,) of their elements, or laws made of such, selected together."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # a subclass is a dataclass

    def select(self, rows) -> Self:
        """The section of the chosen elements."""
        parts = {f.name: getattr(self, f.name) for f in fields(self)}
        chosen = {k: v[rows] if isinstance(v, np.ndarray) else v.select(rows) for k, v in parts.items()}
        return replace(self, **chosen)

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """What the elements are judged by; here nothing."""
        return ()

    def judged(self, force, natural, l0) -> dict[str, np.ndarray]:
        """Name of each of the `criteria` -> values (e,), from section forces and natural deformations (e,6)."""
        return {}


@dataclass(frozen=True, eq=False)
class LinearSection(Section):
    """Linear Timoshenko beam: stiffnesses (e,) `EA` N, `EI_n`, `EI_b` and `GJ` N m^2, shear `kGA_n`, `kGA_b` N.

    EI_n bends about the axis n and goes with the shear kGA_n along b; kGA may be infinite (Euler-Bernoulli).
    """

    EA: np.ndarray
    EI_n: np.ndarray
    EI_b: np.ndarray
    GJ: np.ndarray
    kGA_n: np.ndarray
    kGA_b: np.ndarray

    @classmethod
    def of(cls, count, EA, EI, GJ, kGA=np.inf, EI_b=None):
        """`count` equal elements, with one EI for both axes unless `EI_b` is given."""
        values = (EA, EI, EI if EI_b is None else EI_b, GJ, kGA, kGA)
        return cls(*(np.broadcast_to(float(v), count).copy() for v in values))

    @property
    def initial_bending(self):
        """The larger EI (e,) N m^2 of each element."""
        return np.maximum(self.EI_n, self.EI_b)

    def response(self, natural, l0):
        """Forces (e,6) and tangents (e,6,6) at the natural deformations (e,6)."""
        shear = [12.0 * ei / (kga * l0 * l0) for ei, kga in ((self.EI_n, self.kGA_n), (self.EI_b, self.kGA_b))]
        k = np.zeros((len(l0), 4, 4))
        for plane, ei in enumerate((self.EI_n, self.EI_b)):
            i, j = plane, plane + 2
            unit = ei / (l0 * (1.0 + shear[plane]))
            k[:, i, i] = k[:, j, j] = unit * (4.0 + shear[plane])
            k[:, i, j] = k[:, j, i] = unit * (2.0 - shear[plane])
        q = shortening(1.0 / (1.0 + np.stack(shear, axis=1)) ** 2)
        return coupled(
            natural,
            l0,
            q,
            lambda delta: (self.EA / l0 * delta, self.EA / l0),
            lambda theta: (np.einsum("eij,ej->ei", k, theta), k),
            lambda psi: (self.GJ / l0 * psi, self.GJ / l0),
        )
