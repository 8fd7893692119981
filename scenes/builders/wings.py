"""Closed wings as one conforming surface of quads and triangles: profiles lofted along a line, tips, box wings.

x aft, y to the right, z up, lengths in m. A section is points (n,3) from the trailing edge over the upper side to the
nose and back along the lower one, the trailing edge once; a wing is lofted between sections of equally many points.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from interface.mirror import MIRROR

from .profiles import uniform

TIPS = ("flat", "round", "sewn")
SPANWISE = ("uniform", "cosine")
AXIS = 0.25  # share of the chord where the points of stations lie


@dataclass(frozen=True, eq=False)
class ClosedSurface:
    """A closed body: `nodes` (n,3) m, `panels` (m,4) whose normals point outward (a triangle repeats its last node),
    `trailing_edges` (t,2) pairs of nodes, None where they are to be found; `remarks` on what was changed. Of a lofted
    wing `sections` (k,p) are the nodes round its profiles from tip to tip, each from the trailing edge over the upper
    side to the nose and back; of a parafoil `ribs` (r,) are those of them that are ribs.
    """

    nodes: np.ndarray
    panels: np.ndarray
    trailing_edges: np.ndarray | None
    remarks: tuple[str, ...] = ()
    sections: np.ndarray | None = None
    ribs: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Stations:
    """k sections of a wing in the order of their span, to the right.

    `point` (k,3) m lies on the chord at the share `axis` of it, about which it is turned; `chord` (k,) m; `twist` (k,)
    rad, nose up; `roll` (k,) rad about x, which brings the right hand side up.
    """

    point: np.ndarray
    chord: np.ndarray
    twist: np.ndarray
    roll: np.ndarray
    axis: float = AXIS

    def sections(self, profiles: np.ndarray) -> np.ndarray:
        """Sections (k,n,3) m of `profiles` (k,n,2), or (n,2) of all, in shares of the chord."""
        flat = np.broadcast_to(profiles, (len(self.chord), *profiles.shape[-2:]))
        x, z = self.chord[:, None] * (flat[..., 0] - self.axis), self.chord[:, None] * flat[..., 1]
        c, s = np.cos(self.twist)[:, None], np.sin(self.twist)[:, None]
        aft, up = c * x + s * z, c * z - s * x
        turned = np.stack([aft, -np.sin(self.roll)[:, None] * up, np.cos(self.roll)[:, None] * up], axis=2)
        return self.point[:, None] + turned

    def between(self, strips: int, profiles: np.ndarray) -> tuple["Stations", np.ndarray]:
        """Stations and profiles with `strips` strips between each two, by straight lines."""
        count = len(self.chord)
        at = np.concatenate([np.repeat(np.arange(count - 1), strips), [count - 2]])
        share = np.concatenate([np.tile(np.arange(strips) / strips, count - 1), [1.0]])

        def mixed(values: np.ndarray) -> np.ndarray:
            s = share.reshape(-1, *[1] * (values.ndim - 1))
            return (1.0 - s) * values[at] + s * values[at + 1]

        found = Stations(mixed(self.point), mixed(self.chord), mixed(self.twist), mixed(self.roll), self.axis)
        return found, mixed(np.broadcast_to(profiles, (count, *profiles.shape[-2:])))


# Planforms: the right half, from the middle to the tip


def span_shares(strips: int, spacing: str = "uniform") -> np.ndarray:
    """Shares (strips + 1,) of the half span from the middle to the tip; "cosine": close together towards the tip."""
    if spacing not in SPANWISE:
        raise ValueError(f"strips cannot be spaced '{spacing}' along the span; choose one of: {', '.join(SPANWISE)}.")
    return uniform(strips) if spacing == "uniform" else np.sin(0.5 * np.pi * uniform(strips))


def cell_shares(widths: Sequence[float], strips: int) -> np.ndarray:
    """Shares of the half span where cells of some `widths` m from the middle outward have `strips` strips each."""
    ends = np.concatenate([[0.0], np.cumsum(widths)])
    at = (ends[:-1, None] + np.outer(widths, np.arange(strips) / strips)).ravel()
    return np.append(at / ends[-1], 1.0)


def tapered_chords(shares: np.ndarray, root: float, tip: float) -> np.ndarray:
    """Chords m at shares of the half span that fall, or grow, on a straight line."""
    return root + shares * (tip - root)


def elliptic_chords(shares: np.ndarray, root: float, tip: float) -> np.ndarray:
    """Chords m of an ellipse that is cut where its chord is `tip` m: root sqrt(1 - (1 - (tip / root)^2) share^2).

    With the `axis` at 0.5 and a span of the root chord, it is a circle but for what is cut off.
    """
    return root * np.sqrt(1.0 - (1.0 - (tip / root) ** 2) * shares**2)


@dataclass(frozen=True)
class Planform:
    """The right half of a wing: `span` m of both halves, along the arc where it has one; `root` and `tip` chords m.

    `sweep` rad of the line of stations at the share `axis` of the chord, back towards the tip; `twist` rad of the tip,
    nose up, in proportion to the span; `dihedral` rad, tips up, of a wing whose sections stay upright; or `arc` rad,
    half the angle of a circle that the wing follows, tips down, sections normal to it. Chords are "tapered" or
    "elliptic".
    """

    span: float
    root: float
    tip: float
    sweep: float = 0.0
    twist: float = 0.0
    dihedral: float = 0.0
    arc: float = 0.0
    axis: float = AXIS
    chords: str = "tapered"

    def stations(self, shares: np.ndarray) -> Stations:
        """Stations at shares (k,) of the half span."""
        if self.arc and self.dihedral:
            raise ValueError("a wing has an arc or a dihedral, not both; drop one of them.")
        half = 0.5 * self.span
        chord = (elliptic_chords if self.chords == "elliptic" else tapered_chords)(shares, self.root, self.tip)
        if self.arc:
            radius = half / self.arc
            roll = -shares * self.arc
            y, z = -radius * np.sin(roll), radius * (np.cos(roll) - 1.0)
        else:
            y, z, roll = half * shares, half * shares * np.tan(self.dihedral), np.zeros_like(shares)
        point = np.column_stack([half * shares * np.tan(self.sweep), y, z])
        return Stations(point, chord, shares * self.twist, roll, self.axis)


# Surfaces


def lofted(
    sections: np.ndarray, tip: str = "flat", tip_strips: int = 4, remarks: tuple[str, ...] = ()
) -> ClosedSurface:
    """The wing between `sections` (k,n,3) m, from the left to the right, its tips closed.

    Panels of a strip follow each other from the trailing edge over the upper side to the nose and back; strips follow
    the span, the tips come last. Tips are "flat" caps of quads between upper and lower side, or "round": half turns
    about the middle of the tip, of `tip_strips` panels; or "sewn": both sides of the last section meet half way between
    them, point by point, and nothing closes it. Quads of strips left of y = 0 begin at the image of the corner
    where those of the right begin, so that the mirror image of a wing has mirrored first diagonals.
    """
    return _closed(sections, False, tip, tip_strips, remarks)


def mirrored_wing(
    right: np.ndarray, tip: str = "flat", tip_strips: int = 4, remarks: tuple[str, ...] = ()
) -> ClosedSurface:
    """The wing of which `right` (k,n,3) m are the sections from the plane y = 0 to the right tip, and its image.

    It is its own mirror image to the last bit, and so are the first diagonals of its quads.
    """
    if np.any(right[0, :, 1] != 0.0) or np.any(right[1:, :, 1] <= 0.0):
        raise ValueError("the sections of one half must begin in the plane y = 0 and stay to the right of it.")
    return _closed(np.concatenate([right[:0:-1] * MIRROR, right]), True, tip, tip_strips, remarks)


def _closed(sections, mirrored, tip, tip_strips, remarks):
    """The wing between sections; the left tip is the image of a right one to the last bit where it is `mirrored`."""
    k, n = sections.shape[:2]
    if k < 2 or n < 4:
        raise ValueError("a wing needs two sections at least, of four points at least.")
    if tip not in TIPS:
        raise ValueError(f"tips cannot be '{tip}'; choose one of: {', '.join(TIPS)}.")
    rows = np.arange(k * n).reshape(k, n)
    nodes, panels = (
        [sections.reshape(-1, 3)],
        [_strips(rows, (sections[:-1, :, 1] + sections[1:, :, 1]).sum(axis=1) < 0.0)],
    )
    if tip == "sewn":
        return _sewn(sections, rows, panels[0], remarks)
    make = _flat_tip if tip == "flat" else _round_tip
    count = k * n
    right_nodes, right = make(sections[-1], sections[-1] - sections[-2], rows[-1], count, tip_strips)
    nodes.append(right_nodes)
    count += len(right_nodes)
    image = MIRROR if mirrored else np.ones(3)
    left_nodes, other = make(sections[0] * image, (sections[0] - sections[1]) * image, rows[0], count, tip_strips)
    nodes.append(left_nodes * image)
    panels += [right, _turned_over(other)]
    trailing = np.column_stack([rows[:-1, 0], rows[1:, 0]])
    return ClosedSurface(np.concatenate(nodes), np.concatenate(panels), trailing, remarks, rows)


def _strips(rows, left):
    """Panels (., 4) between rows (k,n) of nodes; those of the strips on the `left` (k - 1,) begin at the corner that is
    the image of the first one of the others.
    """
    after = np.roll(rows, -1, axis=1)
    four = np.stack([rows[:-1], rows[1:], after[1:], after[:-1]], axis=2)
    four[left] = np.roll(four[left], -1, axis=2)
    return four.reshape(-1, 4)


def _turned_over(panels):
    """Panels (m,4) that look to the other side; triangles still repeat their last corner."""
    flipped = panels[:, [0, 3, 2, 1]]
    triangle = panels[:, 2] == panels[:, 3]
    flipped[triangle] = panels[triangle][:, [0, 2, 1, 1]]
    return flipped


def _flat_tip(section, outward, row, count, tip_strips):
    """No nodes, and the panels that close a right tip: quads between opposite points of both sides, with triangles at
    the trailing edge and, of an even number of points, at the nose.
    """
    n = len(row)
    upper, lower = (
        row[1 : n - n // 2 + 1],
        row[: n - n // 2 : -1],
    )  # behind the trailing edge; the upper one has the nose
    panels = [[row[0], lower[0], upper[0], upper[0]]]
    panels += [[upper[i], lower[i], lower[i + 1], upper[i + 1]] for i in range(len(lower) - 1)]
    last = len(lower) - 1
    rest = [upper[last], lower[last], *upper[:last:-1]]
    panels.append([*rest, rest[-1]] if len(rest) == 3 else rest)
    return np.zeros((0, 3)), np.array(panels)


def sewn_section(section: np.ndarray) -> np.ndarray:
    """A section (n,3) m whose two sides meet half way between them, point by point from the trailing edge on; of an odd
    number of points the upper one next to the nose has none below it, and comes half way down.
    """
    found, (upper, lower, more) = section.copy(), _opposite(len(section))
    found[upper] = found[lower] = 0.5 * (section[upper] + section[lower])
    if len(more):
        seam = 0.5 * (found[upper[-1]] + found[_nose(len(section))])
        found[more] = 0.5 * (section[more] + seam)
    return found


def _nose(n):
    """Number of the nose among the n points of a section."""
    return n - n // 2


def _opposite(n):
    """Numbers of the upper and of the lower points that stand above each other, from behind the trailing edge to before
    the nose, and of those of the upper side that have none.
    """
    lower = np.arange(n - 1, _nose(n), -1)
    return np.arange(1, 1 + len(lower)), lower, np.arange(1 + len(lower), _nose(n))


def _sewn(sections, rows, panels, remarks):
    """The wing whose first and last section are sewn, with one node where points meet. Of an odd number of points a
    triangle at the nose is left open by that, and closed.
    """
    k, n = rows.shape
    nodes, to = sections.copy(), rows.copy()
    upper, lower, more = _opposite(n)
    for end in (0, -1):
        nodes[end] = sewn_section(sections[end])
        to[end, lower] = to[end, upper]
    kept = np.unique(to)
    place = np.full(k * n, -1)
    place[kept] = np.arange(len(kept))
    at = place[to]
    trailing = np.column_stack([at[:-1, 0], at[1:, 0]])
    noses = [[row[upper[-1]], row[_nose(n)], row[more[0]]] for row in at[[-1, 0]]] if len(more) else []
    closing = np.array([[a, b, c, c] for a, b, c in noses], dtype=int).reshape(-1, 4)
    closing[1:] = _turned_over(closing[1:])
    quads = at.ravel()[panels]
    return ClosedSurface(nodes.reshape(-1, 3)[kept], np.concatenate([quads, closing]), trailing, remarks, at)


def _round_tip(section, outward, row, count, tip_strips):
    """The nodes and panels of half a turn from the upper to the lower side of a right tip, about the middle of it."""
    n = len(row)
    if n % 2:
        raise ValueError(f"a round tip needs an even number of panels a profile; {n} is odd.")
    if tip_strips < 2:
        raise ValueError("a round tip needs two panels at least from the upper to the lower side.")
    upper, lower = section[1 : n // 2], section[: n // 2 : -1]
    middle, half = 0.5 * (upper + lower), 0.5 * (upper - lower)
    chord = section[n // 2] - section[0]
    up = half.mean(axis=0)
    side = np.cross(up, chord)
    side *= np.sign(np.sum(side * outward.mean(axis=0))) / np.linalg.norm(side)
    angle = np.pi * np.arange(1, tip_strips) / tip_strips
    reach = np.linalg.norm(half, axis=1)[:, None] * side
    ring = middle + np.cos(angle)[:, None, None] * half + np.sin(angle)[:, None, None] * reach
    inner = count + np.arange(ring.shape[0] * ring.shape[1]).reshape(ring.shape[:2])
    lines = np.concatenate([row[None, 1 : n // 2], inner, row[None, : n // 2 : -1]])
    quads = np.stack([lines[:-1, :-1], lines[1:, :-1], lines[1:, 1:], lines[:-1, 1:]], axis=2).reshape(-1, 4)
    tail, nose = np.full(tip_strips, row[0]), np.full(tip_strips, row[n // 2])
    ends = [
        np.column_stack([tail, lines[1:, 0], lines[:-1, 0], lines[:-1, 0]]),
        np.column_stack([nose, lines[:-1, -1], lines[1:, -1], lines[1:, -1]]),
    ]
    return ring.reshape(-1, 3), np.concatenate([quads, *ends])


# Box wings


@dataclass(frozen=True)
class BoxWing:
    """Two wings of equal chord, one above the other, joined by end plates with rounded corners.

    `span` and `height` m between the middles of the profiles, outermost; `chord` m, `radius` m of the corners. Strips
    of each half: `wing_strips` on each wing, spaced uniformly or by "cosine" towards the corner, `corner_strips` in
    each corner, `plate_strips` on the end plate between them.
    """

    span: float
    height: float
    chord: float
    radius: float
    wing_strips: int
    plate_strips: int
    corner_strips: int = 3
    spacing: str = "uniform"

    def line(self) -> Stations:
        """Stations from the middle of the upper wing by the right end plate to the middle of the lower one."""
        r, y, z = self.radius, 0.5 * self.span, 0.5 * self.height
        if not 0.0 < r < min(y, z):
            raise ValueError(f"the corner radius must be above 0 and below half of span and height; it is {r:g} m.")
        along = span_shares(self.wing_strips, self.spacing) * (y - r)
        turn = 0.5 * np.pi * np.arange(1, self.corner_strips) / self.corner_strips
        corner = np.column_stack([y - r + r * np.sin(turn), z - r + r * np.cos(turn)])
        down = (z - r) * (1.0 - 2.0 * np.arange(self.plate_strips + 1) / self.plate_strips)
        upper = np.concatenate(
            [
                np.column_stack([along, np.full(len(along), z), np.zeros(len(along))]),
                np.column_stack([corner, -turn]),
                np.column_stack([np.full(len(down), y), down, np.full(len(down), -0.5 * np.pi)]),
            ]
        )
        below = upper[: len(along) + len(turn)][::-1]
        found = np.concatenate([upper, below * [1.0, -1.0, 1.0]])
        found[len(upper) :, 2] = -np.pi - below[:, 2]
        point = np.column_stack([np.zeros(len(found)), found[:, 0], found[:, 1]])
        k = len(found)
        return Stations(point, np.full(k, self.chord), np.zeros(k), found[:, 2])

    def surface(self, points: np.ndarray) -> ClosedSurface:
        """The closed ring of a profile with `points` (n,2), its upper side outside; ValueError where the profile is
        thicker than the corners allow.

        It is its own mirror image in y = 0 to the last bit.
        """
        if -self.chord * points[:, 1].min() >= self.radius:
            raise ValueError("the corners are rounder than the profile is thick inside; take a larger radius.")
        right = self.line().sections(points)
        right[[0, -1], :, 1] = 0.0
        k, n = right.shape[:2]
        left = right[-2:0:-1] * MIRROR
        sections = np.concatenate([right, left])
        rows = np.arange(len(sections) * n).reshape(-1, n)
        ring = np.concatenate([rows, rows[:1]])
        quads = _strips(ring, np.arange(len(sections)) >= k - 1)
        trailing = np.column_stack([ring[:-1, 0], ring[1:, 0]])
        return ClosedSurface(sections.reshape(-1, 3), quads, trailing)
