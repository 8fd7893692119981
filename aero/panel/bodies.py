"""The surface of closed bodies as the panel method needs it: edges, trailing edges, strips, and its faults.

A `Body` is made once of the shape at rest; it holds indices only, so displaced nodes use it too. Panels are (m,4) node
indices, counter-clockwise seen from outside; a triangle repeats its last one. Sentences count panels, nodes and
trailing edges from 1. Nothing here loops over panels: strips are walked all at once, a step a panel along the chord.
"""

from dataclasses import dataclass

import numpy as np

from interface.mirror import MIRROR, canonical_faces, mirror_permutation, mirror_rows
from interface.panels import area_vectors
from interface.topology import agreed, connected, distinct_pairs, listed, turning
from interface.vectors import cross

CREASE = 45.0  # degrees by which normals turn at an edge, above which the surface folds there
CONCENTRATED = 3.0  # and how many times more than at the next edges: a nose of few panels turns at all of its edges
SHARP = 60.0  # degrees between the two sides of a trailing edge; beyond, a fold is a corner of the body
AFT = 0.2  # share of downstream in the way across a panel to its trailing edge: found up to 78 degrees of sweep
THIN = 1e-9  # area over the square of the longest diagonal or side, below which a panel has none
FAR = 1e9  # m from the origin
ON_PLANE = 1e-6  # of the extent of the body, within which a node lies on the plane y = 0
SLENDEST = 50.0  # spans of a strip in its chords
PREVAILING = 1e-3  # share of a trailing edge's length, below which the sum of its normals says nothing of its sides
_UNLIKE = "the body is not its own mirror image in the plane y = 0"
RAYS = (0.5, 0.02, 0.98)  # where on a trailing edge the rays leave that follow its wake
START = 1e-6  # of the length of a trailing edge, behind which its wake may meet the body


class BodyError(ValueError):
    """What is wrong with a body, in one sentence, and the panels that it is about."""

    def __init__(self, text, *rows):
        self.text, self.rows = text, rows
        super().__init__(self.called("panel"))

    def called(self, noun, numbers=None):
        """The sentence with panels called by another noun, and by their `numbers` (m,), from 1 on by default."""
        rows = [np.asarray(of) for of in self.rows]
        return self.text.format(*(noun + listed(1 + of if numbers is None else numbers[of]) for of in rows))


@dataclass(frozen=True, eq=False)
class Body:
    """The topology of closed bodies of `panels` (m,4), or of their half y > 0 where it is `symmetric`.

    `edges` (e,2) nodes, `sides` (e,2) the panels on either side: the first runs along the edge as it is written, the
    second the other way; it is -1 at the open edges of a half, which lie in the plane y = 0. `of_panel` (m,4) is the
    edge from each corner to the next, -1 from a repeated one.
    `trailing` (t,4): upper panel, lower panel, nodes a, b; the upper panel runs a -> b. Segments that follow each other
    have their upper panels on one side of the sheet: the upper one where that has a meaning, else the outer one of a
    ring, else that of larger y. `trailing_edge` (t,) are their rows of `edges`.
    `creases` (c,) are the edges that are no trailing edges and at which the surface folds. `strips` (t): panels from
    the upper one at the trailing edge round the nose to the lower one, by opposite sides of quads, empty where there is
    no such row. `component` (m,) numbers the bodies.
    """

    panels: np.ndarray
    edges: np.ndarray
    sides: np.ndarray
    of_panel: np.ndarray
    trailing: np.ndarray
    trailing_edge: np.ndarray
    creases: np.ndarray
    strips: tuple[np.ndarray, ...]
    component: np.ndarray
    symmetric: bool = False

    @classmethod
    def of(
        cls, nodes, panels, trailing_edges=None, *, symmetric=False, downstream=(1.0, 0.0, 0.0), crease_angle=CREASE
    ):
        """The body of `nodes` (n,3) m and `panels` (m,4); BodyError in one sentence for what is wrong with it.

        `trailing_edges` (t,2) are pairs of nodes; none of them: a body without lift; None: the sharp edges whose panels
        both lie upstream of them, `downstream` (3,) being the direction of the flow at rest. `symmetric`: panels are
        the half y > 0, open at the plane y = 0. `crease_angle` degrees, beyond which a fold is a crease.
        """
        nodes, panels = np.asarray(nodes, dtype=float), np.asarray(panels)
        _check_panels(nodes, panels)
        edges, sides, of_panel = _paired(panels)
        component = _check_surface(nodes, panels, edges, sides, symmetric)
        normals = _unit(area_vectors(nodes[panels]))
        turn = _turn(nodes, panels, sides, normals)
        if trailing_edges is None:
            rows = _found(nodes, panels, edges, sides, turn, np.asarray(downstream, dtype=float))
        else:
            rows = _given(trailing_edges, edges, sides, turn)
        trailing, rows = _oriented(nodes, edges, sides, normals, rows)
        creases = _creases(sides, of_panel, turn, rows, crease_angle)
        body = cls(
            panels,
            edges,
            sides,
            of_panel,
            trailing,
            rows,
            creases,
            _strips(sides, of_panel, trailing, rows),
            component,
            symmetric,
        )
        body.check_strips(nodes)
        return body

    def check_strips(self, nodes):
        """BodyError where strips are more than 50 times as wide as their chord is long, on `nodes` (n,3) m."""
        longer = np.flatnonzero(self.strip_aspect_ratios(nodes) > SLENDEST)
        if len(longer):
            worst = self.strip_aspect_ratios(nodes)[longer].max()
            raise BodyError(
                f"the strip{listed(1 + longer)} (at the {{0}}) "
                f"{agreed(len(longer), 'is', 'are')} up to {worst:.3g} times as wide as the chord is long, more than "
                f"{SLENDEST:g}; divide the span into more strips.",
                self.trailing[longer, 0],
            )

    def strip_aspect_ratios(self, nodes):
        """Width over chord (t,) of strips on `nodes` (n,3) m, both at the trailing edge's segment; 0 without a strip.

        The chord is the largest distance from the middle of the segment to the centre of a panel of the strip.
        """
        length = np.array([len(strip) for strip in self.strips], dtype=int)
        ratio = np.zeros(len(length))
        if not length.any():
            return ratio
        a, b = nodes[self.trailing[:, 2]], nodes[self.trailing[:, 3]]
        of = np.repeat(np.arange(len(length)), length)
        centre = nodes[self.panels[np.concatenate(self.strips)]].mean(axis=1)
        chord = np.zeros(len(length))
        np.maximum.at(chord, of, np.linalg.norm(centre - 0.5 * (a + b)[of], axis=1))
        there = length > 0
        ratio[there] = np.linalg.norm(b - a, axis=1)[there] / chord[there]
        return ratio

    def unnamed(self, nodes, downstream=(1.0, 0.0, 0.0)):
        """Panels (k,2) on either side of the edges that are sharp, have both panels upstream of them and continue
        trailing edges, on `nodes` (n,3) m, but are no trailing edges themselves.
        """
        turn = _turn(nodes, self.panels, self.sides, _unit(area_vectors(nodes[self.panels])))
        rows = _sharp(nodes, self.panels, self.edges, self.sides, turn, np.asarray(downstream, dtype=float))
        rows = np.setdiff1d(rows, self.trailing_edge)
        ends = self.edges[np.concatenate([rows, self.trailing_edge])]
        line = connected(len(nodes), *ends.T)
        return self.sides[rows[np.isin(line[self.edges[rows, 0]], line[self.edges[self.trailing_edge, 0]])]]

    def check_plane(self, nodes):
        """BodyError where a half of a symmetric body, on `nodes` (n,3) m, goes through the plane y = 0."""
        if self.symmetric:
            _check_half(nodes, self.panels)

    def check_wake(self, nodes, direction):
        """BodyError where the wake that leaves on `nodes` (n,3) m along `direction` (3,) goes into a body.

        Rays leave each trailing edge at its middle and near its ends; they must not begin between its two sides, inside
        the body, nor meet a panel behind.
        """
        if not len(self.trailing):
            return
        d = _unit(np.asarray(direction, dtype=float)[None])[0]
        out = _unit(area_vectors(nodes[self.panels[self.trailing[:, :2].ravel()]])).reshape(-1, 2, 3) @ d
        inside = np.flatnonzero(np.all(out < 0.0, axis=1))
        if len(inside):
            raise BodyError(
                f"the wake goes into the body at its own trailing edge{listed(1 + inside)} (at "
                f"{{0}}): the flow comes from behind there; turn it or the body.",
                self.trailing[inside, 0],
            )
        row, panel = self._first_hit(nodes, d)
        if row >= 0:
            raise BodyError(
                f"the wake of trailing edge {1 + row} (at {{0}}) goes through the body at "
                f"{{1}}; move what lies behind it out of the flow, or change the angle.",
                [self.trailing[row, 0]],
                [panel],
            )

    def _first_hit(self, nodes, d):
        """The first trailing edge whose wake meets a panel, and this panel; -1 and -1 where none does."""
        axes = _across(d)
        a, b = nodes[self.trailing[:, 2]], nodes[self.trailing[:, 3]]
        corners = nodes[self.panels]
        flat, ends = corners @ axes, np.stack([a, b], axis=1) @ axes
        low, high = flat.min(axis=1), flat.max(axis=1)
        near = (corners @ d).max(axis=1) > np.minimum(a @ d, b @ d)[:, None]
        for k in (0, 1):
            near &= ends[:, :, k].max(axis=1)[:, None] >= low[:, k]
            near &= ends[:, :, k].min(axis=1)[:, None] <= high[:, k]
        near[np.arange(len(a))[:, None], self.trailing[:, :2]] = False
        row, panel = np.nonzero(near)
        start, step, last = a[row], (b - a)[row], corners[panel]
        least = START * np.linalg.norm(step, axis=1)
        for share in RAYS:
            met = np.flatnonzero(_way_to(start + share * step, d, last) > least)
            if len(met):
                return int(row[met[0]]), int(panel[met[0]])
        return -1, -1

    @property
    def open_edges(self):
        """Rows of the edges that have a panel on one side only: those of a half in the plane y = 0."""
        return np.flatnonzero(self.sides[:, 1] < 0)

    def half(self, nodes):
        """The half y > 0 of a body that is its own mirror image in the plane y = 0, on the same `nodes` (n,3) m.

        BodyError where it is not, nor its trailing edges are, or where panels lie across the plane.
        """
        return Half.of(self, np.asarray(nodes, dtype=float))

    def part(self, panels):
        """The body of some of the `panels` (h,), with the trailing edges (s,) that have both panels among them."""
        place = np.full(len(self.panels), -1)
        place[panels] = np.arange(len(panels))
        sides = np.where(self.sides >= 0, place[self.sides], -1)
        kept = np.flatnonzero(np.any(sides >= 0, axis=1))
        back = sides[kept, 0] < 0  # the panel that runs along the edge as it is written is left out
        edges = np.where(back[:, None], self.edges[kept][:, ::-1], self.edges[kept])
        sides = np.where(back[:, None], sides[kept][:, ::-1], sides[kept])
        row = np.full(len(self.edges) + 1, -1)
        row[kept] = np.arange(len(kept))
        both = np.flatnonzero(np.all(place[self.trailing[:, :2]] >= 0, axis=1))
        trailing = np.column_stack([place[self.trailing[both, :2]], self.trailing[both, 2:]])
        creases = row[self.creases][row[self.creases] >= 0]
        creases = creases[sides[creases, 1] >= 0]
        rows, of_panel = row[self.trailing_edge[both]], row[self.of_panel[panels]]
        body = Body(
            self.panels[panels],
            edges,
            sides,
            of_panel,
            trailing,
            rows,
            creases,
            _strips(sides, of_panel, trailing, rows),
            self.component[panels],
            True,
        )
        return body, both


@dataclass(frozen=True, eq=False)
class Half:
    """One half of a symmetric whole, and the way back: `body` on the nodes of the whole.

    `panels` (h,) are the rows of the whole that the half has. `of_panel` (m,) is the panel of the half that each panel
    of the whole is, or is the image of (`mirrored` (m,)). `strips` (s,) and `of_strip` (t,) are the same of trailing
    edges, the latter -1 of those in the plane, across which there is no jump; `sign` (t,) is -1 where upper and lower
    are exchanged in the image, 0 in the plane.
    """

    body: Body
    panels: np.ndarray
    of_panel: np.ndarray
    mirrored: np.ndarray
    strips: np.ndarray
    of_strip: np.ndarray
    sign: np.ndarray

    @classmethod
    def of(cls, whole, nodes):
        """See Body.half."""
        used = np.unique(whole.panels)
        tolerance = ON_PLANE * np.ptp(nodes[used], axis=0).max()
        image = np.arange(len(nodes))
        found = mirror_permutation(nodes[used], tolerance)
        if found is None:
            raise BodyError(f"{_UNLIKE}: nodes have no mirror images; solve the whole body.")
        image[used] = used[found]
        rows = mirror_rows(whole.panels, image, canonical_faces)
        odd = np.flatnonzero(rows < 0)
        if len(odd):
            raise BodyError(f"{_UNLIKE}: the {{0}} {_has(odd)} no mirror image; solve the whole body.", odd)
        y = nodes[whole.panels, 1]
        across = np.flatnonzero((y.max(axis=1) > tolerance) & (y.min(axis=1) < -tolerance))
        if len(across):
            raise BodyError(
                f"the {{0}} {agreed(len(across), 'lies', 'lie')} across the plane y = 0; put nodes on it, "
                "or solve the whole body.",
                across,
            )
        own = y.mean(axis=1) > 0.0
        panels = np.flatnonzero(own)
        place = np.full(len(own), -1)
        place[panels] = np.arange(len(panels))
        of_panel = np.where(own, place, place[rows])
        body, strips = whole.part(panels)
        _check_images(whole, image)
        of_strip, sign = _strip_images(whole, image, rows, strips)
        return cls(body, panels, of_panel, ~own, strips, of_strip, sign)

    def whole(self, values):
        """Values of the panels of the half, scalars (h,) or polar vectors (h,3), on those of the whole."""
        found = values[self.of_panel]
        return np.where(self.mirrored[:, None], found * MIRROR, found) if found.ndim > 1 else found

    def whole_strips(self, jumps):
        """Jumps of the potential at the trailing edges (s,) of the half, upper less lower, at those of the whole."""
        return self.sign * np.append(jumps, 0.0)[self.of_strip]


def _check_images(whole, image):
    """Raises where trailing edges have no mirror image; `image` (n,) are the images of nodes."""
    ends, there = np.sort(whole.trailing[:, 2:], axis=1), np.sort(image[whole.trailing[:, 2:]], axis=1)
    _, _, which = distinct_pairs(np.concatenate([ends, there]))
    odd = np.flatnonzero(~np.isin(which[len(ends) :], which[: len(ends)]))
    if len(odd):
        raise BodyError(
            f"{_UNLIKE}: the trailing edge{listed(1 + odd)} (at the {{0}}) {_has(odd)} no mirror image among the "
            "trailing edges; name both, or solve the whole body.",
            whole.trailing[odd, 0],
        )


def _strip_images(whole, image, rows, strips):
    """The strip of the half (t,), and the sign of its jump, of every trailing edge; `image` (n,), `rows` (m,) are the
    images of nodes and panels, `strips` (s,) the trailing edges of the half.
    """
    ends = np.sort(whole.trailing[:, 2:], axis=1)
    there = np.sort(image[whole.trailing[:, 2:]], axis=1)
    _, _, which = distinct_pairs(np.concatenate([ends, there]))
    t = len(ends)
    own = np.full(which.max(initial=-1) + 1, -1)
    own[which[:t][strips]] = np.arange(len(strips))
    here, over = own[which[:t]], own[which[t:]]
    alike = rows[whole.trailing[:, 0]] == whole.trailing[strips[over], 0] if len(strips) else np.zeros(t, dtype=bool)
    of_strip = np.where(here >= 0, here, over)
    sign = np.where(here >= 0, 1.0, np.where(over < 0, 0.0, np.where(alike, 1.0, -1.0)))
    return of_strip, sign


# Edges and their checks


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _check_panels(nodes, panels):
    """Raises where arrays are none of nodes and panels, or panels have no area or are written otherwise."""
    if nodes.ndim != 2 or nodes.shape[1] != 3 or panels.ndim != 2 or panels.shape[1] != 4 or not len(panels):
        raise BodyError("a body needs nodes (n,3) and panels (m,4), one panel at least; correct the arrays.")
    if not np.issubdtype(panels.dtype, np.integer):
        raise BodyError("panels must be whole numbers, the indices of nodes; correct the array.")
    wrong = np.flatnonzero(np.any((panels < 0) | (panels >= len(nodes)), axis=1))
    if len(wrong):
        raise BodyError(f"the {{0}} {_has(wrong)} a corner that is no node of {len(nodes)}; correct it.", wrong)
    wrong = np.flatnonzero(~np.all(np.abs(nodes) <= FAR, axis=1))
    if len(wrong):
        where = agreed(len(wrong), "is at no finite place", "are at no finite places")
        raise BodyError(f"the node{listed(1 + wrong)} {where} within {FAR:g} m; correct the coordinates.")
    same = panels[:, :, None] == panels[:, None, :]
    same[:, 2, 3] = same[:, 3, 2] = False
    wrong = np.flatnonzero(same.sum(axis=(1, 2)) > 4)
    if len(wrong):
        raise BodyError(
            f"the {{0}} {_has(wrong)} a corner twice; only a triangle may repeat its last one (a, b, c, c).", wrong
        )
    corners = nodes[panels]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None, :], axis=3).max(axis=(1, 2))
    wrong = np.flatnonzero(np.linalg.norm(area_vectors(corners), axis=1) <= THIN * longest**2)
    if len(wrong):
        raise BodyError(
            f"the {{0}} {_has(wrong)} no area (corners on one line or at one point, or crossed sides); mend "
            "the mesh there.",
            wrong,
        )


def _has(rows):
    return agreed(len(rows), "has", "have")


def _paired(panels):
    """Edges (e,2), the panels (e,2) on either side, and the edge (m,4) from every corner to the next; see Body.

    BodyError where more than two panels meet at an edge or neighbours have opposite normals.
    """
    m = len(panels)
    ends = np.stack([panels, np.roll(panels, -1, axis=1)], axis=2).reshape(-1, 2)
    real = np.flatnonzero(ends[:, 0] != ends[:, 1])
    edges, _, which = distinct_pairs(np.sort(ends[real], axis=1))
    panel, forward = real // 4, ends[real, 0] < ends[real, 1]
    count = np.bincount(which, minlength=len(edges))
    many = np.flatnonzero(count > 2)
    if len(many):
        a, b = 1 + edges[many[0]]
        others = f" and {len(many) - 1} more edges" if len(many) > 1 else ""
        raise BodyError(
            f"{count[many[0]]} panels ({{0}}) meet at the edge of nodes {a} and "
            f"{b}{others}; a surface has two at every edge: remove what is inside the body or twice.",
            panel[which == many[0]],
        )
    order = np.lexsort((~forward, which))
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    first, second = order[start], order[np.minimum(start + 1, len(order) - 1)]
    pair = count == 2
    _check_turning(m, panel[first[pair]], panel[second[pair]], forward[first[pair]] != forward[second[pair]])
    sides = np.column_stack([panel[first], np.where(pair, panel[second], -1)])
    backward = ~forward[first]
    edges[backward] = edges[backward][:, ::-1]
    of_panel = np.full(4 * m, -1)
    of_panel[real] = which
    return edges, sides, of_panel.reshape(m, 4)


def _check_turning(count, one, other, agree):
    """Raises where neighbours have opposite normals, naming the fewer panels of each body."""
    if np.all(agree):
        return
    turn = turning(count, one, other, agree)
    twisted = np.flatnonzero(~turn.orientable[turn.patch])
    if len(twisted):
        raise BodyError("the surface of the {0} has one side only, like a Moebius strip; it bounds no body.", twisted)
    wrong = np.flatnonzero(turn.flip)
    raise BodyError(
        f"{agreed(len(wrong), 'the normal', 'the normals')} of {{0}} "
        f"{agreed(len(wrong), 'points', 'point')} to the other side than the neighbours'; reverse the order of "
        f"{agreed(len(wrong), 'its', 'their')} corners.",
        wrong,
    )


def _check_surface(nodes, panels, edges, sides, symmetric):
    """Which body (m,) each panel belongs to; raises where bodies are open, inside out or through the plane y = 0."""
    is_open = sides[:, 1] < 0
    if symmetric:
        tolerance = _check_half(nodes, panels)
        is_open &= ~np.all(np.abs(nodes[edges, 1]) <= tolerance, axis=1)
    rows = np.flatnonzero(is_open)
    if len(rows):
        a, b = 1 + edges[rows[0]]
        but = ", except in the plane y = 0" if symmetric else ""
        raise BodyError(
            f"the surface is open at the {{0}} ({len(rows)} "
            f"{agreed(len(rows), 'edge', 'edges')} without a second panel, the first between nodes {a} and {b}); close "
            f"it{but}, or merge the nodes along the gap.",
            np.unique(sides[rows, 0]),
        )
    shut = sides[:, 1] >= 0
    component = connected(len(panels), sides[shut, 0], sides[shut, 1])
    volume, area = _volumes(nodes, panels, component, symmetric)
    none = np.flatnonzero(np.isin(component, np.flatnonzero(np.abs(volume) <= THIN * area**1.5)))
    if len(none):
        raise BodyError("the surface of the {0} encloses no volume; give the body a thickness.", none)
    inward = np.flatnonzero(volume[component] < 0.0)
    if len(inward):
        raise BodyError("the normals of the {0} point into the body; reverse the order of their corners.", inward)
    return component


def _check_half(nodes, panels):
    """Tolerance m of the plane y = 0; raises where panels of a half are beyond it or within it."""
    y = nodes[panels, 1]
    tolerance = ON_PLANE * np.ptp(nodes[np.unique(panels)], axis=0).max()
    beyond = np.flatnonzero(y.min(axis=1) < -tolerance)
    if len(beyond):
        raise BodyError(
            f"the {{0}} of a symmetric half {agreed(len(beyond), 'goes', 'go')} through the plane y = 0 "
            f"(down to y = {y.min():.3g} m); keep the half at y >= 0, or solve the whole body.",
            beyond,
        )
    within = np.flatnonzero(y.max(axis=1) <= tolerance)
    if len(within):
        raise BodyError(
            f"the {{0}} of a symmetric half {agreed(len(within), 'lies', 'lie')} in the plane y = 0; leave "
            f"{agreed(len(within), 'it', 'them')} out: the half is open there.",
            within,
        )
    return tolerance


def _volumes(nodes, panels, component, symmetric):
    """Volume m^3 and surface m^2 (k,) of every body; that of a half is closed by the plane y = 0."""
    apex = nodes[np.unique(panels)].mean(axis=0) * ([1.0, 0.0, 1.0] if symmetric else 1.0)
    x = nodes[panels] - apex
    cone = np.einsum("mk,mk->m", x[:, 0], cross(x[:, 1], x[:, 2]) + cross(x[:, 2], x[:, 3])) / 6.0
    area = np.linalg.norm(area_vectors(x), axis=1)
    return np.bincount(component, cone), np.bincount(component, area)


# Folds: trailing edges and creases


def _turn(nodes, panels, sides, normals):
    """Degrees (e,) by which normals turn from one panel to the other at every edge, negative in a hollow, 0 at an open
    edge.
    """
    one, other = normals[sides[:, 0]], normals[sides[:, 1]]
    angle = np.degrees(np.arctan2(np.linalg.norm(cross(one, other), axis=1), np.einsum("ek,ek->e", one, other)))
    centre = nodes[panels].mean(axis=1)
    away = np.einsum("ek,ek->e", centre[sides[:, 1]] - centre[sides[:, 0]], one - other)
    return np.where(sides[:, 1] < 0, 0.0, np.where(away <= 0.0, angle, -angle))


def _sharp(nodes, panels, edges, sides, turn, downstream):
    """Rows of the sharp edges both of whose panels lie upstream."""
    rows = np.flatnonzero(turn >= 180.0 - SHARP)
    ends = nodes[edges[rows]]
    along = _unit(ends[:, 1] - ends[:, 0])[:, None]
    way = ends.mean(axis=1)[:, None] - nodes[panels[sides[rows]]].mean(axis=2)
    way = _unit(way - np.einsum("esk,esk->es", way, along)[:, :, None] * along)
    return rows[np.all(way @ _unit(downstream[None])[0] > AFT, axis=1)]


def _found(nodes, panels, edges, sides, turn, downstream):
    """The rows of `_sharp` in the order in which they follow each other; BodyError where there are none."""
    rows = _sharp(nodes, panels, edges, sides, turn, downstream)
    if not len(rows):
        raise BodyError(
            "the body has no trailing edge: no edge is sharper than "
            f"{SHARP:g} degrees with both panels upstream of it; name the pairs of nodes, or none for a body without "
            "lift."
        )
    return rows[_followed(edges[rows])]


def _followed(ends):
    """The order (t,) in which segments with `ends` (t,2) follow each other, a line after the other."""
    at: dict[int, list[int]] = {}
    for row, pair in enumerate(ends.tolist()):
        for node in pair:
            at.setdefault(node, []).append(row)
    order: list[int] = []
    left = set(range(len(ends)))
    tips = [rows[0] for rows in at.values() if len(rows) == 1]
    for first in [*tips, *range(len(ends))]:
        following = [first]
        while following and following[0] in left:
            order.append(following[0])
            left.remove(following[0])
            following = [row for node in ends[order[-1]].tolist() for row in at[node] if row in left]
    return np.array(order, dtype=int)


def _given(trailing_edges, edges, sides, turn):
    """Rows of the edges that are given as pairs of nodes; BodyError where they cannot be trailing edges."""
    pairs = np.asarray(trailing_edges)
    if pairs.size == 0:
        return np.zeros(0, dtype=int)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.issubdtype(pairs.dtype, np.integer):
        raise BodyError("trailing edges must be pairs of nodes (t,2); correct the array.")
    ends = np.sort(pairs, axis=1)
    distinct, first, which = distinct_pairs(np.concatenate([np.sort(edges, axis=1), ends]))
    of = np.full(len(distinct), -1)
    of[which[: len(edges)]] = np.arange(len(edges))
    rows = of[which[len(edges) :]]
    none = np.flatnonzero(rows < 0)
    if len(none):
        a, b = 1 + pairs[none[0]]
        raise BodyError(
            f"the trailing edge{listed(1 + none)} {agreed(len(none), 'is', 'are')} no edge of a panel (the first "
            f"between nodes {a} and {b}); name two corners of a panel that follow each other."
        )
    _, first, same = np.unique(rows, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[same] != np.arange(len(rows)))
    if len(again):
        raise BodyError(
            f"the trailing edge{listed(1 + again)} {agreed(len(again), 'stands', 'stand')} twice (the first is number "
            f"{1 + first[same[again[0]]]} again); name each once."
        )
    alone = np.flatnonzero(sides[rows, 1] < 0)
    if len(alone):
        raise BodyError(
            f"the trailing edge{listed(1 + alone)} (at the {{0}}) {_has(alone)} a panel on "
            "one side only, in the plane of symmetry; leave it out.",
            sides[rows[alone], 0],
        )
    blunt = np.flatnonzero(turn[rows] < SHARP)
    if len(blunt):
        raise BodyError(
            f"the trailing edge{listed(1 + blunt)} {_has(blunt)} both panels on one side of the sheet (normals of "
            f"{{0}} turn by {turn[rows[blunt[0]]]:.3g} degrees); name edges where upper and lower "
            "side meet.",
            sides[rows[blunt[0]]],
        )
    return rows


def _oriented(nodes, edges, sides, normals, rows):
    """`trailing` (t,4) of Body for the edges `rows` (t,), and these rows."""
    t = len(rows)
    if not t:
        return np.zeros((0, 4), dtype=int), rows
    ends = edges[rows].ravel()
    order = np.argsort(ends, kind="stable")
    _, start, count = np.unique(ends[order], return_index=True, return_counts=True)
    one, other = order[start[count == 2]], order[start[count == 2] + 1]
    turn = turning(t, one // 2, other // 2, one % 2 != other % 2)
    flip = turn.flip
    length = np.linalg.norm(nodes[edges[rows, 1]] - nodes[edges[rows, 0]], axis=1)
    up = _unit(normals[sides[rows, 0]] - normals[sides[rows, 1]]) * np.where(flip, -length, length)[:, None]
    middle = nodes[edges[rows]].mean(axis=1)
    total = np.bincount(turn.patch, length)

    def share(values, scale):
        found = np.bincount(turn.patch, values)
        return np.where(np.abs(found) > PREVAILING * scale, found, 0.0)

    centre = np.stack([np.bincount(turn.patch, length * middle[:, k]) / total for k in range(3)], axis=1)
    out = middle - centre[turn.patch]
    reach = np.bincount(turn.patch, length * np.linalg.norm(out, axis=1))
    sides_of = np.stack(
        [share(up[:, 2], total), share(np.einsum("tk,tk->t", up, out), reach), share(up[:, 1], total)], axis=1
    )
    prevailing = sides_of[np.arange(len(total)), np.argmax(sides_of != 0.0, axis=1)]
    flip = (flip ^ (prevailing < 0.0)[turn.patch])[:, None]
    panels = np.where(flip, sides[rows][:, ::-1], sides[rows])
    return np.concatenate([panels, np.where(flip, edges[rows][:, ::-1], edges[rows])], axis=1), rows


def _creases(sides, of_panel, turn, rows, limit):
    """Rows of the edges that are creases: folds beyond `limit` degrees which the surface beside them does not share."""
    sharp = np.abs(turn) > limit
    sharp[rows] = False
    at = np.flatnonzero(sharp)
    beside = np.zeros((len(at), 2))
    for k in (0, 1):
        own = of_panel[sides[at, k]]
        slot = np.argmax(own == at[:, None], axis=1)
        opposite = own[np.arange(len(at)), (slot + 2) % 4]
        beside[:, k] = np.where(np.all(own >= 0, axis=1), np.abs(turn[opposite]), 0.0)
    return at[np.abs(turn[at]) >= CONCENTRATED * beside.min(axis=1)]


def _strips(sides, of_panel, trailing, rows):
    """Panels (t) of every strip; see Body. All strips are walked at once."""
    t = len(rows)
    if not t:
        return ()
    quad = np.all(of_panel >= 0, axis=1)
    wake = np.zeros(len(sides), dtype=bool)
    wake[rows] = True
    whole = np.zeros(t, dtype=bool)
    steps = []
    strip, panel, edge = np.arange(t), trailing[:, 0], rows
    while len(strip):
        step = np.full(t, -1)
        step[strip] = panel
        steps.append(step)
        on = quad[panel]
        strip, panel, edge = strip[on], panel[on], edge[on]
        slot = np.argmax(of_panel[panel] == edge[:, None], axis=1)
        edge = of_panel[panel, (slot + 2) % 4]
        whole[strip[edge == rows[strip]]] = True
        after = np.where(sides[edge, 0] == panel, sides[edge, 1], sides[edge, 0])
        on = ~wake[edge] & (after >= 0)
        strip, panel, edge = strip[on], after[on], edge[on]
    walked = np.array(steps, dtype=int).reshape(len(steps), t).T
    return tuple(row[row >= 0] if ok else row[:0] for row, ok in zip(walked, whole, strict=True))


# Wakes through bodies


def _across(direction):
    """Two unit vectors as columns (3,2), normal to a unit vector and to each other."""
    helper = np.eye(3)[np.argmin(np.abs(direction))]
    first = _unit(np.cross(direction, helper)[None])[0]
    return np.column_stack([first, np.cross(direction, first)])


def _way_to(start, direction, corners):
    """Distance m (r,) along `direction` (3,) from `start` (r,3) to panels with `corners` (r,4,3), -inf where they are
    not met. A panel is the two triangles on its first diagonal.
    """
    way = np.full(len(start), -np.inf)
    for k in ((0, 1, 2), (0, 2, 3)):
        a, b, c = (corners[:, i] - start for i in k)
        sums = np.stack([cross(b, c) @ direction, cross(c, a) @ direction, cross(a, b) @ direction], axis=1)
        normal = cross(b - a, c - a)
        along = normal @ direction
        met = (np.all(sums >= 0.0, axis=1) | np.all(sums <= 0.0, axis=1)) & (along != 0.0)
        found = np.einsum("rk,rk->r", normal, a)
        way = np.where(met, np.maximum(way, np.divide(found, along, out=np.full(len(way), -np.inf), where=met)), way)
    return way
