"""Lifting-line strips on deformed sections: where the bound vortices and control points are."""

from dataclasses import dataclass

import numpy as np

from interface.vectors import cross

QUARTER, THREE_QUARTER = 0.25, 0.75


def unit(v):
    """Rows of v (n,3) divided by their length."""
    return v / np.sqrt(np.einsum("ik,ik->i", v, v))[:, None]


@dataclass(frozen=True, eq=False)
class Strips:
    """Geometry of n strips between n + 1 sections, ordered along the span so that chord x span points to suction.

    `bound` (n+1,3) quarter-chord points of the sections, `trailing_edge` (n+1,3), `control` (n,3) three-quarter-chord
    and `centre` (n,3) quarter-chord points of the strips, `chord` (n,), `width` (n,) along the bound vortex, all in
    m; unit vectors `tangent` (along the chord, aft), `span` (along the bound vortex), `normal` (suction side), each
    (n,3).
    """

    bound: np.ndarray
    trailing_edge: np.ndarray
    control: np.ndarray
    centre: np.ndarray
    chord: np.ndarray
    width: np.ndarray
    tangent: np.ndarray
    span: np.ndarray
    normal: np.ndarray

    def at_control(self, leading, trailing):
        """Values (n,k) at the control points of what varies linearly between those (n+1,k) at the sections' edges."""
        behind = leading + THREE_QUARTER * (trailing - leading)
        return behind[:-1] + control_fractions(self.width)[:, None] * (behind[1:] - behind[:-1])

    def pitch_rate(self, leading, trailing):
        """Nose-up pitch rates (n,) rad/s of the strips, from the velocities (n+1,3) m/s of the sections' edges."""
        across = leading - trailing
        middle = across[:-1] + control_fractions(self.width)[:, None] * (across[1:] - across[:-1])
        return np.einsum("ik,ik->i", middle, self.normal) / self.chord


def control_fractions(width):
    """Where along each strip (n,) its control point lies, 0 to 1, from the strip widths (n,).

    Half way on equal strips, the half angle on cosine-spaced ones, where it makes induced drag exact (van Garrel 2003,
    ECN-C-03-079).
    """
    if len(width) == 1:
        return np.array([0.5])
    ratio = width[:-1] / (width[:-1] + width[1:])
    fraction = np.empty_like(width)
    fraction[0], fraction[-1] = ratio[0], ratio[-1]
    fraction[1:-1] = 0.25 * (ratio[:-1] + ratio[1:] + 1.0)
    return fraction


def strips_between(leading_edge, trailing_edge):
    """Strips between consecutive sections, from their edge points (n+1,3) each."""
    chords = trailing_edge - leading_edge
    bound = leading_edge + QUARTER * chords
    span = bound[1:] - bound[:-1]
    width = np.sqrt(np.einsum("ik,ik->i", span, span))
    fraction = control_fractions(width)[:, None]
    centre = bound[:-1] + fraction * span
    behind = leading_edge + THREE_QUARTER * chords
    control = behind[:-1] + fraction * (behind[1:] - behind[:-1])
    half_chord = control - centre
    span = span / width[:, None]
    return Strips(
        bound,
        trailing_edge,
        control,
        centre,
        2.0 * np.sqrt(np.einsum("ik,ik->i", half_chord, half_chord)),
        width,
        unit(half_chord),
        span,
        unit(cross(half_chord, span)),
    )
