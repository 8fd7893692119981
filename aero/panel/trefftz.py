"""Forces in the Trefftz plane, far downstream, where the wake is a sheet that the flow crosses along its vortices.

The sheet is made of strips, projected across the free stream. Lift and side force are those of Kutta and Joukowski,
rho U x (jump l) with l a strip from a to b; the induced drag is the energy that the sheet leaves behind per length
(Katz and Plotkin 2001, section 8.3.2),

    D = -rho / 4 pi  int int dG(s) dG(t) ln r(s, t),

nothing of the body, so that pressures need not be integrated. Between the strips' own values the circulation G is
linear, and nothing is shed at points: what the strips that meet at a node bring there adds up to zero, at a free end
for one strip alone. Sheets may end, close, as that of a box wing, or branch. The drag is of order 2 in the width of
strips where these get narrower towards free ends as they do with cosine spacing, of order 1 where they do not.
"""

from dataclasses import dataclass

import numpy as np

from interface.vectors import cross

# Gauss points and weights along a strip; with the other integral exact, of integrands with logarithms at their ends.
POINTS, WEIGHTS = (0.5 * v for v in np.polynomial.legendre.leggauss(8))
POINTS = POINTS + 0.5


@dataclass(frozen=True, eq=False)
class FarWake:
    """What the wake says of the forces: `strip_force` (s,3) N across the stream of each strip, the strips' projected
    `width` (s,) m, and the `induced_drag` N along the stream.
    """

    strip_force: np.ndarray
    width: np.ndarray
    induced_drag: float

    @property
    def lift(self):
        """Force (3,) N across the stream."""
        return self.strip_force.sum(axis=0)

    def span_efficiency(self, span, dynamic_pressure):
        """e = L^2 / (q pi b^2 D), L the whole force across the stream and b the `span` m; 0 without drag."""
        least = np.finfo(float).tiny
        if not self.induced_drag > least:
            return 0.0
        return float(self.lift @ self.lift) / (dynamic_pressure * np.pi * span**2 * self.induced_drag)


def far_wake(nodes, ends, jumps, direction, speed, density):
    """The `FarWake` of strips that leave the `nodes` (n,3) m between their `ends` (s,2), a and b, with `jumps` (s,)
    m^2/s of doublets whose normal is direction x (b - a), in a stream of `speed` m/s, a number or that of each strip
    (s,), along the unit vector `direction` (3,) and of `density` kg/m^3.
    """
    force, width = strip_forces(nodes, ends, jumps, direction, speed, density)
    if not len(jumps):
        return FarWake(force, width, 0.0)
    flat = nodes - np.outer(nodes @ direction, direction)
    a, b = flat[ends[:, 0]], flat[ends[:, 1]]
    shed = _shed(ends, jumps, width)
    return FarWake(force, width, -density / (4.0 * np.pi) * float(shed @ _mean_logarithms(a, b, direction) @ shed))


def strip_forces(nodes, ends, jumps, direction, speed, density):
    """Force (s,3) N across the stream of each strip between its `ends`, and its width (s,) m there; see far_wake."""
    flat = nodes - np.outer(nodes @ direction, direction)
    a, b = flat[ends[:, 0]], flat[ends[:, 1]]
    across = cross(b - a, np.broadcast_to(direction, a.shape))  # against the normal, as long as the strip is wide
    speed = np.asarray(speed)[..., None]
    return density * speed * jumps[:, None] * across, np.linalg.norm(across, axis=1)


def _shed(ends, jumps, width):
    """Circulation (s,) m^2/s that each strip sheds between its ends.

    Of what the strips bring to a node, with the sign of the end that is there, each gives up a share by its width so
    that nothing is left: between two strips that is linear interpolation, at a free end zero.
    """
    count, sign = ends.max() + 1, np.array([-1.0, 1.0])
    brought = np.bincount(ends.ravel(), weights=np.outer(jumps, sign).ravel(), minlength=count)
    wide = np.bincount(ends.ravel(), weights=np.repeat(width, 2), minlength=count)
    wide = np.where(wide > 0.0, wide, 1.0)
    at_end = jumps[:, None] - sign * width[:, None] * (brought / wide)[ends]
    return at_end[:, 1] - at_end[:, 0]


def _mean_logarithms(a, b, direction):
    """Mean of ln r (s,s) between the points of any two strips from a to b (s,3) m, in the plane across `direction`."""
    along = b - a
    length = np.linalg.norm(along, axis=1)
    some = length > 0.0
    tangent = along / np.where(some, length, 1.0)[:, None]
    normal = cross(np.broadcast_to(direction, tangent.shape), tangent)
    found = np.zeros((len(a), len(a)))
    for share, weight in zip(POINTS, WEIGHTS, strict=True):
        r = (a + share * along)[:, None] - a
        x, y = np.einsum("psc,sc->ps", r, tangent), np.abs(np.einsum("psc,sc->ps", r, normal))
        whole = _logarithm_integral(length - x, y) - _logarithm_integral(-x, y)
        found += weight * whole / np.where(some, length, 1.0)
    found[:, ~some] = 0.0  # strips along the stream shed nothing
    return 0.5 * (found + found.T)


def _logarithm_integral(u, y):
    """Integral of ln sqrt(u^2 + y^2) over u, y >= 0."""
    square = u * u + y * y
    return 0.5 * u * np.log(np.where(square > 0.0, square, 1.0)) - u + y * np.arctan2(u, y)
