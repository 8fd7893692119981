"""Forces in the Trefftz plane, far downstream, where the wake is a sheet that the flow crosses along its vortices.

The sheet is made of strips of constant jump of the potential, projected across the free stream. The momentum and the
energy that it leaves behind per length are the lift, side force and induced drag of what shed it (Katz and Plotkin
2001, section 8.3.2):

    F = rho U x sum(jump l),   D = -rho / 2 sum(jump w_n |l|),

with l the projected strip from a to b and w_n the velocity across it, by the straight vortices at its ends and those of
all others: nothing of the body, so that pressures need not be integrated. Sheets may be closed, as that of a box wing.
"""

from dataclasses import dataclass

import numpy as np

from interface.vectors import cross

@dataclass(frozen=True, eq=False)
class FarWake:
    """What the wake says of the forces: `force` (3,) N, `induced_drag` N with it along the free stream, and by strip
    the `strip_force` (s,3) N across the stream and its `width` (s,) m.
    """

    force: np.ndarray
    induced_drag: float
    strip_force: np.ndarray
    width: np.ndarray

    def span_efficiency(self, span, dynamic_pressure):
        """e = L^2 / (q pi b^2 D) of the lift with the `span` b m; 0 where there is no drag."""
        lift = float(self.strip_force.sum(axis=0) @ self.strip_force.sum(axis=0))
        least = np.finfo(float).tiny
        return lift / (dynamic_pressure * np.pi * span**2 * self.induced_drag) if self.induced_drag > least else 0.0


def far_wake(a, b, jumps, direction, speed, density, control=None):
    """The `FarWake` of strips between the points `a`, `b` (s,3) m at the trailing edge, with `jumps` (s,) m^2/s of the
    doublets whose normal is direction x (b - a), in a stream of `speed` m/s along the unit vector `direction` (3,) of
    `density` kg/m^3. `control` (s,) is where along each strip, 0 to 1, the flow across it is taken, by default half
    way (see `control_fractions`).
    """
    flat_a, flat_b = (p - np.outer(p @ direction, direction) for p in (a, b))
    along = np.broadcast_to(direction, flat_a.shape)
    across = cross(flat_b - flat_a, along)  # against the normal, as long as the strip is wide
    force = density * speed * jumps[:, None] * across
    at = 0.5 if control is None else control[:, None]
    velocity = _velocity(flat_a + at * (flat_b - flat_a), flat_a, flat_b, jumps, direction)
    drag = -0.5 * density * float(jumps @ np.einsum("sc,sc->s", velocity, across))
    return FarWake(force.sum(axis=0) + drag * direction, drag, force, np.linalg.norm(across, axis=1))


def _velocity(points, a, b, jumps, along):
    """Velocity (p,3) m/s in the Trefftz plane at `points` (p,3) m by strips (s,) between a and b (s,3) m.

    The potential falls by the jump from below a strip to above it: that is a pair of vortices along the stream, at a
    with the jump as circulation and at b against it. A vortex G gives G (along x r) / 2 pi r^2.
    """
    found = np.zeros_like(points)
    for end, sign in ((a, 1.0), (b, -1.0)):
        r = points[:, None] - end
        r2 = np.einsum("psc,psc->ps", r, r)
        weight = sign * jumps / (2.0 * np.pi * np.where(r2 > 0.0, r2, np.inf))
        found += np.einsum("ps,psc->pc", weight, r)
    return cross(np.broadcast_to(along, points.shape), found)


def control_fractions(ends, width):
    """Where along each strip (s,) the flow across it is taken, from its `ends` (s,2) node numbers and `width` (s,) m:
    towards the narrower of its neighbours, the strips that share one end with it alone.

    Half way between equal ones, the half angle on cosine-spaced ones, where it makes the induced drag of elliptic
    loading exact (van Garrel 2003, ECN-C-03-079).
    """
    before, after = _neighbour_widths(ends, width)
    toward_a, toward_b = before / (before + width), width / (width + after)
    inner = 0.25 * (toward_a + toward_b + 1.0)
    free_a, free_b = np.isnan(before), np.isnan(after)
    fraction = np.where(free_a, toward_b, np.where(free_b, toward_a, inner))
    return np.where(free_a & free_b, 0.5, fraction)


def _neighbour_widths(ends, width):
    """Widths (2,s) of the strips beyond the ends a and b, NaN where there is none, or more than one."""
    flat = ends.ravel()
    shared = np.bincount(flat)[flat] == 2
    strip = np.arange(len(flat)) // 2
    total = np.bincount(flat, weights=width[strip])[flat]  # of both strips at an end
    beyond = np.where(shared, total - width[strip], np.nan)
    return beyond.reshape(-1, 2).T
