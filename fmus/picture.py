"""Pictures of a scene for its FMUs: the drawing in the documentation (SVG) and the icon (PNG)."""

import struct
import zlib
from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from scenes import Scene

# Views: title, and the directions of the axes of the drawing, right and up, in the global frame (x downwind, z up).
VIEWS = (
    ("from behind, x towards you", (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ("from the left, x to the right", (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ("from above, x downwards", (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)),
)
PIXELS = 260.0  # width or height that a view fills at most
GAP = 34.0
SIZE = 64  # pixels of the icon
COLOURS = {"structural": (0x1F, 0x4E, 0x79), "aero": (0x00, 0x7A, 0x6C)}


def drawing(scene: Scene) -> str:
    """SVG of the design shape in three views of one scale: panels of the interface, and lines, springs and tubes."""
    panels = scene.interface.nodes[scene.interface.panels]
    lines = _lines(scene)
    points = np.concatenate([panels.reshape(-1, 3), lines.reshape(-1, 3)])
    flat = [np.array([right, up]) for _, right, up in VIEWS]
    extent = max(float(np.ptp(points @ axes.T, axis=0).max()) for axes in flat)
    scale = PIXELS / max(extent, 1e-9)
    parts, left, height = [], GAP / 2, 0.0
    for (title, _, _), axes in zip(VIEWS, flat, strict=True):
        low, high = (points @ axes.T).min(axis=0), (points @ axes.T).max(axis=0)
        wide = max(float(high[0] - low[0]) * scale, 150.0)
        middle = left + wide / 2 - scale * float(low[0] + high[0]) / 2
        place = np.array([scale, -scale]), np.array([middle, GAP + scale * float(high[1])])
        parts.append(f'<text x="{left + wide / 2:.0f}" y="16" text-anchor="middle">{title}</text>')
        parts.append(f'<path class="p" d="{_path(_placed(panels, axes, place), "Z")}"/>')
        parts.append(f'<path class="l" d="{_path(_placed(lines, axes, place), "")}"/>')
        left, height = left + wide + GAP, max(height, float(high[1] - low[1]) * scale)
    length = 10.0 ** np.floor(np.log10(extent / 2))
    bar, base = length * scale, GAP + height + 20.0
    parts.append(f'<path class="l" d="M{GAP / 2:.1f} {base:.1f}h{bar:.1f}m0 -4v8m{-bar:.1f} 0v-8"/>')
    parts.append(f'<text x="{GAP / 2 + bar + 8:.1f}" y="{base + 4:.1f}">{length:g} m</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left:.0f} {base + 12:.0f}" role="img" '
        f'aria-label="design shape in three views">\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _lines(scene: Scene) -> np.ndarray:
    """Ends of all lines, springs and tubes in the design shape, (k, 2, 3) m."""
    nodes, members = scene.members.nodes, scene.members
    legs = [np.stack([group.nodes[:, :-1], group.nodes[:, 1:]], axis=-1).reshape(-1, 2) for group in members.chains]
    if members.wing is not None:
        legs.append(members.wing.tubes.ends)
    ends = np.concatenate(legs)
    return np.asarray(nodes[np.unique(np.sort(ends, axis=1), axis=0)])


def _placed(shapes: np.ndarray, axes: np.ndarray, place: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return np.asarray(shapes @ axes.T * place[0] + place[1])


def _path(shapes: np.ndarray, end: str) -> str:
    return "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in shape) + end for shape in shapes)


def icon(scene: Scene | None, side: str) -> bytes:
    """PNG of the wing from behind in the colour of the side, on white: with its lines for the structural one, with
    the lift on it for the other.
    """
    strokes: list[tuple[np.ndarray, float]] = []
    if scene is not None:
        axes = np.array([VIEWS[0][1], VIEWS[0][2]])
        edge = scene.interface.nodes[scene.interface.sections[:, 0]] @ axes.T
        if side == "structural":
            lines = _lines(scene) @ axes.T
        else:
            along = np.linspace(0.0, len(edge) - 1.0, 7)
            feet = np.stack([np.interp(along, np.arange(len(edge)), values) for values in edge.T], axis=-1)
            lift = 0.35 * np.ptp(edge, axis=0).max() * np.sin(np.linspace(0.2, np.pi - 0.2, 7))
            lines = np.stack([feet, feet + np.outer(lift, [0.0, 1.0])], axis=1)
        every = np.concatenate([edge, lines.reshape(-1, 2)])
        low, high = every.min(axis=0), every.max(axis=0)
        scale = (SIZE - 10.0) / float((high - low).max())
        shift = SIZE / 2 - scale * (low + high) / 2
        strokes = [(scale * leg + shift, 0.5 if side == "structural" else 1.0) for leg in lines]
        strokes += [(scale * np.array(pair) + shift, 1.7) for pair in pairwise(edge)]
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
