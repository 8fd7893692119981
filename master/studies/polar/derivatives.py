"""Stability derivatives of a rigid wing: where it is in trim, central differences there, neutral point and margin."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from master.studies.polar.wing import COEFFICIENTS, Point, Reference

STEP = 0.25  # deg to either side: of cl = sin(6 alpha), whose bend is that of a section near its maximum, 1e-4 is lost
TRIM_TOLERANCE = 1e-7  # deg


class NoDerivatives(ValueError):
    """Why there are no derivatives, in one sentence."""


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of the coefficients at the angles `alpha` and `beta` deg, which are `why` (in words): `by_alpha` and
    `by_beta` per rad, name of the coefficient -> value; `static_margin` in chords, and the `neutral_point` (3,) m.

    The neutral point is on the axis of the wing through the reference point; about it C_M does not change with alpha.
    The margin is how far it lies behind the reference point, above zero where the wing is stable in pitch.
    """

    alpha: float
    beta: float
    why: str
    at: dict[str, float]
    by_alpha: dict[str, float]
    by_beta: dict[str, float]
    static_margin: float
    neutral_point: np.ndarray

    def record(self) -> dict[str, Any]:
        """As polar.json has it."""
        return {
            "alpha_deg": self.alpha,
            "beta_deg": self.beta,
            "chosen": self.why,
            "coefficients": self.at,
            "per_rad_of_alpha": self.by_alpha,
            "per_rad_of_beta": self.by_beta,
            "static_margin": self.static_margin,
            "neutral_point_m": self.neutral_point,
        }


def derivatives(
    at: Callable[[float, float], Point], reference: Reference, points: Sequence[Point], alpha: float | None = None
) -> Derivatives:
    """Derivatives at an `alpha` deg; None: where C_M falls through zero among the `points` that were solved at the
    smallest sideslip, or else rises through it, or else in the middle of them. `at` solves a point.

    NoDerivatives where a point that is needed has no answer.
    """
    beta = min({p.beta for p in points}, key=abs)
    why = "given"
    if alpha is None:
        alpha, why = trim(at, [p for p in points if p.beta == beta])
    middle = _needed(at, alpha, beta)
    of_alpha = [_needed(at, alpha + side * STEP, beta) for side in (-1.0, 1.0)]
    of_beta = [_needed(at, alpha, beta + side * STEP) for side in (-1.0, 1.0)]
    by_alpha, by_beta = (_slopes(low, high) for low, high in (of_alpha, of_beta))
    up = reference.axes[:, 2]
    low, high = of_alpha
    pitch = float((high.moment - low.moment) @ reference.axes[:, 1])
    normal = float((high.force - low.force) @ up)
    behind = -pitch / normal if normal != 0.0 else np.nan
    neutral = reference.about + behind * reference.axes[:, 0]
    return Derivatives(
        alpha, beta, why, middle.coefficients, by_alpha, by_beta, behind / reference.chord, neutral
    )  # fmt: skip


def _slopes(low: Point, high: Point) -> dict[str, float]:
    width = 2.0 * np.deg2rad(STEP)
    return {name: float((high.coefficients[name] - low.coefficients[name]) / width) for name in COEFFICIENTS}


def trim(at: Callable[[float, float], Point], points: Sequence[Point]) -> tuple[float, str]:
    """Angle deg of no pitching moment and what it is in words, among points of one sideslip; their middle without."""
    solved = sorted((p for p in points if p.converged), key=lambda p: p.alpha)
    if not solved:
        raise NoDerivatives("no point has an answer, so that there are no derivatives.")
    pairs = [(a, b) for a, b in pairwise(solved) if a.coefficients["CM"] * b.coefficients["CM"] <= 0.0]
    falls = [(a, b) for a, b in pairs if a.coefficients["CM"] > b.coefficients["CM"]]
    if not pairs:
        middle = 0.5 * (solved[0].alpha + solved[-1].alpha)
        return middle, "the middle of the angles, as C_M has no zero among them"
    low, high = (falls or pairs)[0]
    from scipy.optimize import brentq

    def moment(alpha: float) -> float:
        return _needed(at, alpha, low.beta).coefficients["CM"]

    found = float(brentq(moment, low.alpha, high.alpha, xtol=TRIM_TOLERANCE))
    return found, "where C_M is zero" + ("" if falls else " (it rises there: no stable trim)")


def _needed(at: Callable[[float, float], Point], alpha: float, beta: float) -> Point:
    point = at(alpha, beta)
    if not point.converged:
        raise NoDerivatives(
            f"no derivatives, as there is no answer at alpha {alpha:.6g}, beta {beta:.6g} deg: "
            f"{point.message.rstrip('.')}."
        )
    return point
