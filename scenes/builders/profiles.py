"""Wing profiles: NACA of four and five digits, CST, coordinates; closed at the trailing edge, and points round them.

Lengths are shares of the chord: x from the nose (0) to the trailing edge (1), z up. A side is a function of t from 0 at
the nose to 1 at the trailing edge, which for coordinates is x; for NACA the x of the camber line.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from scipy.interpolate import CubicSpline

Side = Callable[[np.ndarray], np.ndarray]

OPEN_THICKNESS = (
    0.2969,
    -0.1260,
    -0.3516,
    0.2843,
    -0.1015,
)  # of sqrt(x), x, x^2, x^3, x^4 (Abbott & von Doenhoff 1959)
CLOSED_THICKNESS = (*OPEN_THICKNESS[:4], -0.1036)  # with z = 0 at x = 1
# Reflexed camber lines of five digits: digits 2 and 3 -> end r of the forward part, k1 at a design lift coefficient of
# 0.3, k2 / k1 (Jacobs & Pinkerton, NACA report 537, 1935, table II; Ladson & Brooks, NASA TM X-3284, 1975).
REFLEX = {
    "21": (0.1300, 51.990, 0.000764),
    "31": (0.2170, 15.793, 0.00677),
    "41": (0.3180, 6.520, 0.0303),
    "51": (0.4410, 3.191, 0.1355),
}
BLUNT = 1e-9  # of the chord, above which a trailing edge is blunt
FINE = 4000  # pieces of a side along which its length and the places of x are found
FEWEST = 6  # points of a profile


@dataclass(frozen=True)
class Profile:
    """A profile of an `upper` and a `lower` side, each a function of t (k,) that returns points (k,2); `remarks` say
    what was changed when it was made.
    """

    name: str
    upper: Side
    lower: Side
    remarks: tuple[str, ...] = ()

    @property
    def gap(self) -> float:
        """Thickness of the trailing edge."""
        end = np.ones(1)
        return float(np.linalg.norm(self.upper(end)[0] - self.lower(end)[0]))

    def closed(self) -> "Profile":
        """The profile with a blunt trailing edge closed by a wedge: both sides move to the middle of the edge, in
        proportion to t; `remarks` say so. One that is closed comes back as it is.
        """
        if self.gap <= BLUNT:
            return self
        end = np.ones(1)
        half = 0.5 * (self.upper(end)[0] - self.lower(end)[0])
        upper, lower = self.upper, self.lower
        return replace(
            self,
            upper=lambda t: upper(t) - t[:, None] * half,
            lower=lambda t: lower(t) + t[:, None] * half,
            remarks=(
                *self.remarks,
                f"profile {self.name}: its blunt trailing edge, {100.0 * self.gap:.3g} % of the chord thick, is closed "
                "by a wedge over the whole chord.",
            ),
        )

    def points(
        self, panels: int, spacing: str = "cosine", growth: float = 0.05, through: Sequence[float] = ()
    ) -> np.ndarray:
        """Points (panels,2) from the trailing edge over the upper side to the nose and back along the lower one.

        Of an odd number of panels the upper side has one more. `spacing` is one of SPACINGS; `growth` is how much
        longer each panel is than the next one towards the nose, where it is "geometric". Each t of `through` has
        a point on both sides: the nearest one is moved there, and those between such points in proportion.
        ValueError where the trailing edge is blunt, or the panels are too few to enclose a profile.
        """
        if panels < 4:
            raise ValueError(f"a profile has 4 panels at least; {panels} are too few.")
        if self.gap > BLUNT:
            raise ValueError(f"profile {self.name} has a blunt trailing edge; close it first.")
        above = _places(self.upper, panels - panels // 2, spacing, growth)
        below = _places(self.lower, panels // 2, spacing, growth)
        upper, lower = self.upper(_moved_to(above, through)), self.lower(_moved_to(below, through))
        return np.concatenate([0.5 * (upper[-1:] + lower[-1:]), upper[-2::-1], lower[1:-1]])

    def thickness(self, t: np.ndarray) -> np.ndarray:
        """Distance (k,) of the two sides at the same t."""
        return np.linalg.norm(self.upper(t) - self.lower(t), axis=1)

    def camber(self, t: np.ndarray) -> np.ndarray:
        """Points (k,2) half way between the two sides at the same t."""
        return 0.5 * (self.upper(t) + self.lower(t))


# Spacing along a side, from the nose to the trailing edge


def cosine(count: int) -> np.ndarray:
    """Shares (count + 1,) of a length, close together at both ends."""
    return 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, count + 1)))


def uniform(count: int) -> np.ndarray:
    """Shares (count + 1,) of a length, at equal distances."""
    return np.linspace(0.0, 1.0, count + 1)


def geometric(count: int, growth: float) -> np.ndarray:
    """Shares (count + 1,) of a length in a geometric progression: each piece is longer by `growth` than that before."""
    pieces = (1.0 + growth) ** np.arange(count)
    shares = np.concatenate([[0.0], np.cumsum(pieces)]) / pieces.sum()
    shares[-1] = 1.0
    return shares


SPACINGS = ("cosine", "geometric", "uniform")  # of x; of the length along the side


def _places(side: Side, count: int, spacing: str, growth: float) -> np.ndarray:
    """t (count + 1,) of the ends of the panels of a side."""
    if spacing == "cosine":
        return cosine(count)
    if spacing not in SPACINGS:
        raise ValueError(f"points of a profile cannot be spaced '{spacing}'; choose one of: {', '.join(SPACINGS)}.")
    shares = uniform(count) if spacing == "uniform" else geometric(count, growth)
    fine = cosine(FINE)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(side(fine), axis=0), axis=1))])
    # sqrt(t) is even along a round nose, so that straight pieces between its values are
    found = np.interp(shares * length[-1], length, np.sqrt(fine)) ** 2
    found[0], found[-1] = 0.0, 1.0
    return found


def self_crossing(points: np.ndarray) -> tuple[float, ...]:
    """Places x at which sides of the polygon of points (n,2) cross sides that are not their neighbours, rising."""
    a, b = points, np.roll(points, -1, axis=0)
    along = b - a

    def turned(start: np.ndarray, to: np.ndarray) -> np.ndarray:
        way = to[None, :] - start[:, None]
        return along[:, None, 0] * way[..., 1] - along[:, None, 1] * way[..., 0]

    first, last = turned(a, a), turned(a, b)
    parted = first * last < 0.0
    rows, others = np.nonzero(np.triu(parted & parted.T, 2))
    share = first.T[rows, others] / (first.T - last.T)[rows, others]
    return tuple(sorted((a[rows, 0] + share * along[rows, 0]).tolist()))


def _moved_to(places: np.ndarray, through: Sequence[float]) -> np.ndarray:
    """Places (k,) of the points of a side, moved so that one stands at each of `through`; its ends are at 0 and 1
    already. ValueError where the points are too few for that.
    """
    wanted = np.sort([t for t in through if 0.0 < t < 1.0])
    inner = places[1:-1]
    rows = 1 + np.abs(inner - wanted[:, None]).argmin(axis=1) if len(wanted) else np.zeros(0, dtype=int)
    at = np.concatenate([[0], rows, [len(places) - 1]])
    shift = np.interp(np.arange(len(places)), at, np.concatenate([[0.0], wanted - places[rows], [0.0]]))
    if len(np.unique(rows)) < len(rows) or np.any(np.diff(places + shift) <= 0.0):
        raise ValueError("points that are wanted on a profile are too near to each other; take more panels round it.")
    return places + shift


# Families


def naca(digits: str, closed: bool = True) -> Profile:
    """A NACA profile of four digits ("2412") or five ("23012", "23112"); ValueError for others.

    Thickness is laid off normal to the camber line. `closed`: the last coefficient of the thickness is -0.1036, so that
    the trailing edge has none; else it is the original -0.1015, 0.21 % of the chord for 10 % thickness.
    """
    text = digits.upper().replace("NACA", "").strip(" -")
    if not text.isascii() or not text.isdigit() or len(text) not in (4, 5):
        raise ValueError(f"'{digits}' is no NACA profile of four or five digits; write it as 0012 or 23012.")
    thickness = int(text[-2:]) / 100.0
    if not thickness:
        raise ValueError(f"NACA {text} has no thickness; the last two digits are per cent of the chord.")
    line = _four_digit_line(text) if len(text) == 4 else _five_digit_line(text)
    factors = CLOSED_THICKNESS if closed else OPEN_THICKNESS

    def side(sign: float) -> Side:
        def points(t: np.ndarray) -> np.ndarray:
            half = _half_thickness(t, thickness, factors)
            z, slope = line(t)
            length = np.hypot(1.0, slope)
            return np.column_stack([t - sign * half * slope / length, z + sign * half / length])

        return points

    return Profile(f"NACA {text}", side(1.0), side(-1.0))


def _half_thickness(t, thickness, factors):
    """Half the thickness of the NACA families, 5 tau (a0 sqrt(t) + a1 t + ... + a4 t^4)."""
    powers = np.stack([np.sqrt(t), t, t**2, t**3, t**4], axis=1)
    half = 5.0 * thickness * (powers @ np.array(factors))
    return np.where(t >= 1.0, 5.0 * thickness * _at_end(factors), half)


def _at_end(factors):
    """The sum of the factors, free of rounding where it is zero."""
    return round(float(sum(factors)), 12)


def _four_digit_line(text):
    """Camber and its slope: m / p^2 (2 p x - x^2) before p, m / (1 - p)^2 (1 - 2 p + 2 p x - x^2) behind."""
    m, p = int(text[0]) / 100.0, int(text[1]) / 10.0
    if bool(m) != bool(p):
        raise ValueError(
            f"NACA {text} has {'camber without its place' if m else 'a place of camber without camber'}; its first two "
            "digits are both zero or both not."
        )

    def line(t):
        if not m:
            return np.zeros_like(t), np.zeros_like(t)
        scale = np.where(t < p, m / p**2, m / (1.0 - p) ** 2)
        offset = np.where(t < p, 0.0, 1.0 - 2.0 * p)
        return scale * (offset + 2.0 * p * t - t**2), 2.0 * scale * (p - t)

    return line


def _five_digit_line(text):
    """Camber and its slope. Plain: k1/6 (x^3 - 3 r x^2 + r^2 (3 - r) x) before r, k1 r^3 / 6 (1 - x) behind; reflexed
    (third digit 1): k1/6 ((x - r)^3 - k2/k1 (1 - r)^3 x - r^3 x + r^3) before r, with k2/k1 (x - r)^3 first behind.

    r follows from the place of the largest camber, r (1 - sqrt(r / 3)) = p, and k1 from the design lift coefficient of
    thin-aerofoil theory, 0.15 times the first digit.
    """
    lift, place, reflex = 0.15 * int(text[0]), text[1], text[2]
    if reflex not in "01" or place not in "12345" or not lift or (reflex == "1" and place + reflex not in REFLEX):
        raise ValueError(
            f"NACA {text} has no camber line: of five digits the first is 1 to 9, the second 1 to 5, the third 0, or 1 "
            "(reflexed) with the second 2 to 5."
        )
    if reflex == "1":
        r, k1, ratio = REFLEX[place + reflex]
        k1 *= lift / 0.3
    else:
        r, ratio = _end_of_curvature(0.05 * int(place)), 0.0
        q = (3.0 * r - 7.0 * r**2 + 8.0 * r**3 - 4.0 * r**4) / np.sqrt(r * (1.0 - r))
        k1 = 6.0 * lift / (q - 1.5 * (1.0 - 2.0 * r) * (0.5 * np.pi - np.arcsin(1.0 - 2.0 * r)))

    def line(t):
        factor = np.where(t < r, 1.0, ratio)
        fall = ratio * (1.0 - r) ** 3 + r**3
        z = k1 / 6.0 * (factor * (t - r) ** 3 - fall * t + r**3)
        return z, k1 / 6.0 * (3.0 * factor * (t - r) ** 2 - fall)

    return line


def _end_of_curvature(place):
    """r with r (1 - sqrt(r / 3)) = place, by Newton's method."""
    r = place
    for _ in range(50):
        r -= (r * (1.0 - np.sqrt(r / 3.0)) - place) / (1.0 - 1.5 * np.sqrt(r / 3.0))
    return r


def cst(
    upper: Sequence[float],
    lower: Sequence[float],
    nose: float = 0.5,
    tail: float = 1.0,
    gap: float = 0.0,
    name: str = "CST",
) -> Profile:
    """Class and shape functions of Kulfan: z = +- t^nose (1 - t)^tail sum_i w_i B_i(t) +- t gap / 2.

    `upper` and `lower` are the weights w of the Bernstein polynomials B of degree len - 1; both count away from the
    chord, so that equal weights give a symmetric profile. `gap` is the thickness of the trailing edge.
    """
    if not len(upper) or not len(lower):
        raise ValueError("a CST profile needs a weight at least for each side.")

    def side(sign: float, weights: Sequence[float]) -> Side:
        n = len(weights) - 1

        def points(t: np.ndarray) -> np.ndarray:
            shape = sum(w * comb(n, i) * t**i * (1.0 - t) ** (n - i) for i, w in enumerate(weights))
            return np.column_stack([t, sign * (t**nose * (1.0 - t) ** tail * shape + 0.5 * gap * t)])

        return points

    return Profile(name, side(1.0, upper), side(-1.0, lower))


def from_coordinates(points: np.ndarray, name: str = "coordinates") -> Profile:
    """The profile through points (k,2), round from the trailing edge to it, either way: a cubic spline over the length.

    The nose is its foremost point; it is moved to x = 0, and lengths are scaled so that the trailing edge is at x = 1,
    with a remark where that changes anything. ValueError where they are too few or do not go round a profile.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise ValueError(f"profile {name}: its points must be pairs of finite numbers x, z.")
    points = points[np.concatenate([[True], np.any(np.diff(points, axis=0) != 0.0, axis=1)])] if len(points) else points
    if len(points) < FEWEST:
        raise ValueError(f"profile {name} has {len(points)} different points; {FEWEST} are needed at least.")
    x, z = points.T
    area = 0.5 * float(np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z))
    if not abs(area) > 1e-6 * np.ptp(x) ** 2:
        raise ValueError(f"profile {name} encloses no area; its points must go round it.")
    if area < 0.0:
        points = points[::-1]
    if abs(points[0, 0] - points[-1, 0]) > 0.05 * np.ptp(x) or points[:, 0].argmin() in (0, len(points) - 1):
        raise ValueError(f"profile {name} does not begin and end at its trailing edge; order its points round it.")
    return _splined(points, name)


def _splined(points, name):
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    spline = CubicSpline(s, points)
    turning = [r for r in spline.derivative().roots(extrapolate=False)[0] if s[0] < r < s[-1]]
    first = int(points[:, 0].argmin())
    near = [r for r in turning if s[first - 1] <= r <= s[first + 1]]
    nose = min(near, key=lambda r: float(spline(r)[0]), default=s[first])
    foremost, aft = float(spline(nose)[0]), 0.5 * float(points[0, 0] + points[-1, 0])
    chord = aft - foremost
    remarks: tuple[str, ...] = ()
    if abs(foremost) > 1e-3 or abs(chord - 1.0) > 1e-3:
        remarks = (
            f"profile {name}: its chord from x = {foremost:.4g} to {aft:.4g} is scaled to 1, its nose moved to x = 0.",
        )
    place = np.array([foremost, 0.0])

    def side(end: float) -> Side:
        # s where sqrt(x) has its values: x grows with the square of s at a round nose
        fine = nose + (end - nose) * cosine(FINE)
        there = np.maximum.accumulate(np.sqrt(np.maximum((spline(fine)[:, 0] - foremost) / chord, 0.0)))
        there /= there[-1]

        def points_of(t: np.ndarray) -> np.ndarray:
            return (spline(np.interp(np.sqrt(t), there, fine)) - place) / chord

        return points_of

    return Profile(name, side(s[0]), side(s[-1]), remarks)
