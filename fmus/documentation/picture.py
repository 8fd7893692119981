"""Pictures of a scene for its FMUs: the drawing in the documentation (SVG) and the icon (PNG)."""

import struct
import zlib
from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from interface import area_vectors
from scenes import Scene

_BEHIND_LEFT = np.array([1.0, -0.8, 0.6])  # from where the spatial view looks, in the global frame


def _seen_from(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions to the right and up, (3,) each, in a parallel view from far away in the direction `place`."""
    right = np.cross([0.0, 0.0, 1.0], place)
    right /= np.linalg.norm(right)
    return right, np.cross(place / np.linalg.norm(place), right)


# Views: title, and the directions of the axes of the drawing, right and up, in the global frame (x downwind, z up).
VIEWS = (
    ("from behind, left and above", *_seen_from(_BEHIND_LEFT)),
    ("from behind", np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])),
    ("from above", np.array([0.0, 1.0, 0.0]), np.array([-1.0, 0.0, 0.0])),
    ("from the left", np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])),
)
COLUMNS = ((0,), (1, 2), (3,))  # views above each other share their horizontal axis
PIXELS = 260.0  # width or height that a view fills at most
FINE = 10.0  # units of the shapes in a pixel: they are written as integers
MARGIN, TITLE, AXES = 24.0, 24.0, 76.0  # between columns; above a view, and below it for its axes
SIGHT = 2.0  # arrows that look shorter point along the line of sight
SIZE = 64  # pixels of the icon
COLOURS = {"structural": (0x1F, 0x4E, 0x79), "aero": (0x00, 0x7A, 0x6C)}


def drawing(scene: Scene, side: str = "structural", arrow: tuple[str, np.ndarray] | None = None) -> str:
    """SVG of the design shape in four views of one scale: the panels of the interface and, for the structural side,
    springs, lines and tubes, for the other one the exposed lines. `arrow` is a name and a global direction (3,) shown
    with the axes. The canopy of an inflatable wing is shown by its panels alone, a closed body by its outline and its
    trailing edges.
    """
    panels = scene.interface.nodes[scene.interface.panels]
    strokes = _strokes(scene, side)
    points = np.concatenate([panels.reshape(-1, 3), *(legs.reshape(-1, 3) for _, _, legs in strokes)])
    flat = [points @ np.array(axes).T for _, *axes in VIEWS]
    scale = PIXELS / max(1e-9, *(float(np.ptp(shape, axis=0).max()) for shape in flat))
    parts, left, height = [], MARGIN, 0.0
    for column in COLUMNS:
        wide, top = max(150.0, *(float(np.ptp(flat[k][:, 0])) * scale for k in column)), 0.0
        for k in column:
            title, *axes = VIEWS[k]
            low, high = flat[k].min(axis=0), flat[k].max(axis=0)
            origin = left + wide / 2 - scale * (low[0] + high[0]) / 2, top + TITLE + scale * high[1]
            below = top + TITLE + scale * (high[1] - low[1])
            parts.append(f'<g class="v"><text x="{left + wide / 2:.0f}" y="{top + 13:.0f}">{title}</text>')
            parts.append(f'<g transform="translate({origin[0]:.1f} {origin[1]:.1f}) scale({1 / FINE:g})">')
            if scene.body is None:
                parts += _shapes(panels, strokes, np.array(axes), scale * FINE)
            else:
                parts += _shapes(
                    panels[:0], [("k", 0.0, _outline(scene, np.array(axes)))], np.array(axes), scale * FINE
                )
            parts.append("</g>" + _axes(np.array(axes), arrow, left + wide / 2, below + AXES / 2) + "</g>")
            top = below + AXES
        left, height = left + wide + MARGIN, max(height, top)
    length = 10.0 ** np.floor(np.log10(PIXELS / 2 / scale))
    bar = length * scale
    parts.append(f'<path class="a" d="M{MARGIN:.0f} {height + 8:.1f}h{bar:.1f}m0-4v8m{-bar:.1f} 0v-8"/>')
    parts.append(f'<text class="s" x="{MARGIN + bar + 8:.1f}" y="{height + 12:.1f}">{length:g} m</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left:.0f} {height + 20:.0f}" role="img" '
        f'aria-label="design shape in {len(VIEWS)} views">\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _strokes(scene: Scene, side: str) -> list[tuple[str, float, np.ndarray]]:
    """Class, true width in m (0 for none) and ends (k, 2, 3) m of what is drawn over the panels of a side."""
    members, mesh = scene.members, scene.interface
    if side != "structural":
        return [("l", 0.0, mesh.nodes[mesh.lines])] if len(mesh.lines) else []
    canopy = set() if members.wing is None else {name for name, *_ in members.wing.springs}
    kinds: dict[str, list[np.ndarray]] = {"k": [], "l": []}
    for group in members.chains:
        for nodes, two_way, name in zip(group.nodes, group.two_way, group.names, strict=True):
            if name not in canopy:
                kinds["k" if two_way else "l"].append(np.stack([nodes[:-1], nodes[1:]], axis=-1))
    if members.membranes is not None:
        kinds["l"] += list(members.membranes.seams.values())
    strokes = [(kind, 0.0, members.nodes[_once(np.concatenate(legs))]) for kind, legs in kinds.items() if legs]
    if members.wing is not None:
        tubes = members.wing.tubes
        thick = np.maximum(np.round(2.0 * tubes.radius, 2), 0.01)
        strokes += [("t", float(d), members.nodes[tubes.ends[thick == d]]) for d in np.unique(thick)]
    return strokes


def _once(ends: np.ndarray) -> np.ndarray:
    """Pairs of nodes (k, 2), each once."""
    return np.unique(np.sort(ends, axis=1), axis=0)


def _shapes(
    panels: np.ndarray, strokes: list[tuple[str, float, np.ndarray]], axes: np.ndarray, scale: float
) -> list[str]:
    """Panels seen on their lower side, what runs between, and panels seen on their upper (suction) side.

    Each of the two goes around in one sense, so that panels which cover each other do not cancel.
    """
    flip = np.array([scale, -scale])
    flat = panels @ axes.T * flip
    d, e = flat[:, 2] - flat[:, 0], flat[:, 3] - flat[:, 1]
    turn = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]  # below zero where the normal points to the viewer, as y is down here
    parts = [f'<path class="q" d="{_path(flat[turn >= 0.0], "Z")}"/>']
    for kind, width, legs in strokes:
        own = f' style="stroke-width:{width * scale:.0f}"' if width else ""
        parts.append(f'<path class="{kind}"{own} d="{_path(legs @ axes.T * flip)}"/>')
    return [*parts, f'<path class="p" d="{_path(flat[turn < 0.0], "Z")}"/>']


def _path(shapes: np.ndarray, end: str = "") -> str:
    whole = np.round(shapes).astype(int).tolist()
    return "".join("M" + " ".join(f"{x} {y}" for x, y in shape) + end for shape in whole)


def _axes(axes: np.ndarray, arrow: tuple[str, np.ndarray] | None, x: float, y: float) -> str:
    """The global axes in a view, left of (x, y), and the arrow of what acts on the kite, right of it."""
    parts = []
    for name, direction in zip("xyz", np.eye(3), strict=True):
        seen, foot = _seen(axes, direction), np.array([x - 32.0, y])
        parts.append(_arrow(axes, direction, foot, "a"))
        sideways = float(np.linalg.norm(seen)) > SIGHT
        at = foot + seen * (1.0 + 7.0 / np.linalg.norm(seen)) if sideways else foot + np.array([-11.0, 5.0])
        parts.append(f'<text x="{at[0]:.1f}" y="{at[1] + 4:.1f}">{name}</text>')
    if arrow is not None:
        name, direction = arrow[0], arrow[1] / max(float(np.linalg.norm(arrow[1])), 1e-300)
        seen, middle = _seen(axes, direction), np.array([x + 32.0, y])
        parts.append(_arrow(axes, direction, middle - seen / 2, "w"))
        parts.append(f'<text class="w" x="{middle[0]:.1f}" y="{y + abs(seen[1]) / 2 + 15:.1f}">{name}</text>')
    return "".join(parts)


def _seen(axes: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """A unit vector as an arrow in the drawing, where y is down."""
    return np.asarray(20.0 * (axes @ direction) * np.array([1.0, -1.0]))


def _arrow(axes: np.ndarray, direction: np.ndarray, foot: np.ndarray, kind: str) -> str:
    """An arrow; along the line of sight a circle with a point, its tip, or with a cross, its feathers."""
    seen = _seen(axes, direction)
    length, tip = float(np.linalg.norm(seen)), foot + seen
    if length <= SIGHT:
        near = float(np.cross(axes[0], axes[1]) @ direction) > 0.0
        mark = "m3 0a1 1 0 1 0 2 0a1 1 0 1 0-2 0" if near else "m1.2-2.8l5.6 5.6m0-5.6l-5.6 5.6"
        start = foot - np.array([4.0, 0.0])
        return f'<path class="{kind}" d="M{start[0]:.1f} {start[1]:.1f}a4 4 0 1 0 8 0a4 4 0 1 0-8 0{mark}"/>'
    along = seen / length
    back, across = -5.0 * along, 2.5 * np.array([-along[1], along[0]])
    barbs = "".join(f"M{tip[0]:.1f} {tip[1]:.1f}l{b[0]:.1f} {b[1]:.1f}" for b in (back + across, back - across))
    return f'<path class="{kind}" d="M{foot[0]:.1f} {foot[1]:.1f}L{tip[0]:.1f} {tip[1]:.1f}{barbs}"/>'


def _lines(scene: Scene) -> np.ndarray:
    """Ends of all lines, springs and tubes in the design shape, (k, 2, 3) m."""
    nodes, members = scene.members.nodes, scene.members
    legs = [np.stack([group.nodes[:, :-1], group.nodes[:, 1:]], axis=-1).reshape(-1, 2) for group in members.chains]
    if members.wing is not None:
        legs.append(members.wing.tubes.ends)
    if members.membranes is not None:
        corners = members.membranes.group.nodes[:, [0, 1, 2, 0]]
        legs += list(members.membranes.seams.values()) or [corners[:, k : k + 2] for k in range(3)]
    ends = np.concatenate(legs)
    return np.asarray(nodes[_once(ends)])


def _outline(scene: Scene, axes: np.ndarray) -> np.ndarray:
    """Ends (k, 2, 3) m of the trailing edges of a closed body, and of what bounds it in a view: edges between a panel
    that is seen from outside and one that is not.
    """
    mesh = scene.interface
    edges, panel = mesh.panel_edges
    seen = area_vectors(mesh.nodes[mesh.panels]) @ np.cross(axes[0], axes[1]) > 0.0
    order = np.lexsort(np.sort(edges, axis=1).T)  # the two sides of an edge stand beside each other
    edges, sides = edges[order[::2]], seen[panel[order]].reshape(-1, 2)
    bounds = edges[sides[:, 0] != sides[:, 1]]
    ends = bounds if mesh.trailing_edges is None else np.concatenate([bounds, mesh.trailing_edges])
    return np.asarray(mesh.nodes[_once(ends)])


def icon(scene: Scene | None, side: str) -> bytes:
    """PNG of the wing from behind in the colour of the side, on white: with its lines for the structural one, with
    the lift on it for the other.
    """
    strokes: list[tuple[np.ndarray, float]] = []
    bold = 1.7
    if scene is not None:
        places = scene.interface.nodes[scene.interface.sections[:, 0]]
        ends = _lines(scene) if scene.has_structure else np.zeros((0, 2, 3))
        views = [VIEWS[1 if scene.members.membranes is None else 0], *VIEWS]
        drawn = scene.interface.nodes if scene.body is not None else np.concatenate([places, ends.reshape(-1, 3)])
        spread = [np.ptp(drawn @ np.array(v[1:]).T, axis=0).max() for v in views]
        first = int(np.argmax(np.array(spread) > 1e-6 * max(spread)))  # none that looks along a single line
        axes = np.array(views[first][1:])
        edge = places @ axes.T
        if scene.body is not None:
            lines = _outline(scene, axes) @ axes.T
        elif side == "structural" or not len(edge):
            lines = ends @ axes.T
        else:
            along = np.linspace(0.0, len(edge) - 1.0, 7)
            feet = np.stack([np.interp(along, np.arange(len(edge)), values) for values in edge.T], axis=-1)
            lift = 0.35 * np.ptp(edge, axis=0).max() * np.sin(np.linspace(0.2, np.pi - 0.2, 7))
            lines = np.stack([feet, feet + np.outer(lift, [0.0, 1.0])], axis=1)
        every = np.concatenate([edge, lines.reshape(-1, 2)])
        low, high = every.min(axis=0), every.max(axis=0)
        scale = (SIZE - 10.0) / float((high - low).max())
        shift = SIZE / 2 - scale * (low + high) / 2
        thin = {"structural": 0.5, "aero": 1.0}.get(side, 1.0) if len(edge) else bold
        strokes = [(scale * leg + shift, thin) for leg in lines]
        strokes += [(scale * np.array(pair) + shift, bold) for pair in pairwise(edge)]
    return _png(strokes, COLOURS.get(side, (0x44, 0x44, 0x44)))


def _png(strokes: Iterable[tuple[np.ndarray, float]], colour: tuple[int, int, int]) -> bytes:
    """Straight strokes (ends in pixels from the lower left corner, half width) in one colour, with soft edges."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] + 0.5
    here = np.stack([x, SIZE - y], axis=-1)
    ink = np.zeros((SIZE, SIZE))
    for (a, b), half in strokes:
        along = b - a
        t = np.clip((here - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        away = np.linalg.norm(here - a - t[..., None] * along, axis=-1)
        ink = np.maximum(ink, np.clip(half + 0.5 - away, 0.0, 1.0))
    pixels = np.round(255.0 + ink[..., None] * (np.array(colour) - 255.0)).astype(np.uint8)
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    head = struct.pack(">IIBBBBB", SIZE, SIZE, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
