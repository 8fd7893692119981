"""Meshes of simple surfaces: rectangle, disc, airbag, cylinder, sphere, and surfaces ruled between profiles.

All are structured, so their mirror images are meshes of the same kind. `order` 1 makes triangles of three nodes, 2 of
six, whose middle nodes lie on the curved surface or rim where there is one. Cells, that is quads, become triangles by
`diagonals`:

- "crossed": four, around a node in the middle of the cell; symmetric whatever the numbers of cells,
- "union-jack": two, with diagonals that alternate from cell to cell like a chessboard; symmetric about the middle of a
  side with an even number of cells,
- "one-way": two, all diagonals alike; not symmetric,
- "shorter": two, along the shorter diagonal, the first one where they are equal.

Raises ValueError in one sentence for sizes that are not positive, or do not fit each other.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .mesh import Parts, TriangleMesh, joined, mirrored, quadratic, turned, welded

DIAGONALS = ("crossed", "union-jack", "one-way", "shorter")
CLOSE = 1e-9  # nodes nearer than this times the extent are one
_SECTORS = (6, 4, 8, 10)  # of end caps, the roundest triangles first; even, so that half a cap is half of them


def rectangle(
    length: float, width: float, cells: tuple[int, int], diagonals: str = "crossed", order: int = 1
) -> TriangleMesh:
    """A rectangle from 0 to `length` m in x and to `width` m in y, normal along z, of `cells` in x and y.

    Parts: the triangles "sheet"; the lines "x_min", "x_max", "y_min", "y_max" on its sides; the points "corner_1" ...
    "corner_4" round from the origin.
    """
    _positive(length=length, width=width)
    _counts(cells=min(cells))
    along, across = (np.linspace(0.0, size, n + 1) for size, n in zip((length, width), cells, strict=True))
    grid = np.stack([*np.meshgrid(along, across, indexing="ij"), np.zeros((len(along), len(across)))], axis=2)
    nodes, index, triangles = _grid(grid, diagonals)
    sides = {"x_min": index[0], "x_max": index[-1], "y_min": index[:, 0], "y_max": index[:, -1]}
    corners = index[[0, -1, -1, 0], [0, 0, -1, -1]]
    points = {f"corner_{k + 1}": corners[[k]] for k in range(4)}
    return _finished(nodes, triangles, {"sheet": np.arange(len(triangles))}, sides, points, order, label="rectangle")


def disc(radius: float, rings: int, sectors: int = 6, share: str = "whole", order: int = 1) -> TriangleMesh:
    """A disc around the origin in the plane z = 0, normal along z, of `rings` with `sectors` k triangle bases in the
    k-th: `sectors` rings^2 triangles, none of them slender.

    `share` "half" is its half with y >= 0, for an even number of sectors, "quarter" its quarter with x, y >= 0, for a
    multiple of four; only with these is the whole disc symmetric too. Parts: the triangles "disc"; the lines "rim" and,
    of a half or quarter, "symmetry_y" in the plane y = 0 and "symmetry_x" in x = 0; the point "centre".
    """
    _positive(radius=radius)
    _counts(rings=rings)
    divisor = _one_of("share", share, {"whole": 1, "half": 2, "quarter": 4})
    if sectors < 4 or sectors % divisor:
        need = {1: "4 or more", 2: "4 or more, even", 4: "a multiple of four"}[divisor]
        raise ValueError(f"sectors of a {share} disc must be {need}; there are {sectors}.")
    taken, whole = sectors // divisor, share == "whole"
    nodes, rows, triangles = [np.zeros((1, 3))], [np.zeros(taken + 1, dtype=int)], []
    for k in range(1, rings + 1):
        angle = 2.0 * np.pi / sectors * np.arange(taken * k + (not whole)) / k
        at = radius * k / rings * np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=1)
        rows.append(sum(map(len, nodes)) + np.arange(taken * k + 1) % len(angle))
        nodes.append(np.where(np.abs(at) < CLOSE * radius, 0.0, at))
        s, j = (a.ravel() for a in np.meshgrid(np.arange(taken), np.arange(k), indexing="ij"))
        inner, outer = rows[k - 1], rows[k]
        low, high = s * (k - 1) + j, s * k + j
        if k == 1:
            low = s
        outside = np.stack([inner[low], outer[high], outer[high + 1]], axis=1)
        inside = j < k - 1
        between = np.stack([inner[low], outer[high + 1], inner[np.minimum(low + 1, len(inner) - 1)]], axis=1)
        triangles += [outside, between[inside]]
    lines = {"rim": rows[-1]}
    if not whole:
        first, last = (np.array([0, *(r[end] for r in rows[1:])]) for end in (0, -1))
        if share == "half":
            lines["symmetry_y"] = np.concatenate([last[:0:-1], first])
        else:
            lines |= {"symmetry_y": first, "symmetry_x": last}
    found, every = np.concatenate(triangles), np.concatenate(nodes)

    def on_rim(middle, ends):
        rim = np.all(np.linalg.norm(every[ends], axis=2) > (1.0 - CLOSE) * radius, axis=1)
        scale = np.where(rim, radius / np.maximum(np.linalg.norm(middle, axis=1), CLOSE * radius), 1.0)
        return middle * scale[:, None]

    parts, points = {"disc": np.arange(len(found))}, {"centre": np.zeros(1, dtype=int)}
    return _finished(every, found, parts, lines, points, order, on_rim, label="disc")


def airbag(edge: float, cells: int, share: str = "whole", diagonals: str = "crossed", order: int = 1) -> TriangleMesh:
    """Two flat square sheets of side `edge` m on top of each other, closed at their seam, around the origin in the
    plane z = 0, of `cells` in half an edge. Normals point outward: upward above, downward below.

    `share` "upper" is the upper sheet, "eighth" its quarter with x, y >= 0: 4 cells^2 triangles where they are crossed.
    Parts: the triangles "upper" and "lower"; the lines "seam" and, of an eighth, "symmetry_x" in the plane x = 0 and
    "symmetry_y" in y = 0; the points "centre" of the upper sheet, "mid_x" and "mid_y", the middles of the edges that
    the x and y axis meet, and "corner".
    """
    _positive(edge=edge)
    _counts(cells=cells)
    _one_of("share", share, {"whole": 1, "upper": 1, "eighth": 1})
    if share == "whole" and diagonals not in ("crossed", "union-jack"):
        raise ValueError("diagonals of a whole airbag must be crossed or union-jack: others cut the corners off twice.")
    half, quarter = 0.5 * edge, share == "eighth"
    side, count = (half, cells) if quarter else (edge, 2 * cells)
    sheet = rectangle(side, side, (count, count), diagonals, order)
    nodes = sheet.nodes.copy()
    nodes[:, :2] -= 0.0 if quarter else half
    seam = ("x_max", "y_max") if quarter else ("x_min", "x_max", "y_min", "y_max")
    lines = {"seam": sheet.lines_of(*seam)}
    if quarter:
        lines |= {"symmetry_x": sheet.line_parts["x_min"], "symmetry_y": sheet.line_parts["y_min"]}
    x, y = (1.0 - CLOSE) * half < np.abs(nodes[:, :2]).T
    x0, y0 = CLOSE * half > np.abs(nodes[:, :2]).T
    points = {"centre": x0 & y0, "mid_x": x & y0, "mid_y": x0 & y, "corner": x & y}
    upper = replace(
        sheet,
        nodes=nodes,
        triangle_parts={"upper": sheet.triangle_parts["sheet"]},
        line_parts=lines,
        point_parts={name: np.flatnonzero(at) for name, at in points.items()},
        label="airbag",
    )
    return _with_lower_sheet(upper) if share == "whole" else upper


def _with_lower_sheet(upper: TriangleMesh) -> TriangleMesh:
    """The same sheet below, with all nodes of its own but those of the seam."""
    n, m = len(upper.nodes), len(upper.triangles)
    own = np.setdiff1d(np.arange(n), upper.nodes_of("seam"))
    below = np.arange(n)
    below[own] = n + np.arange(len(own))
    lower = turned(replace(upper, triangles=below[upper.triangles]), np.arange(m))
    return replace(
        upper,
        nodes=np.concatenate([upper.nodes, upper.nodes[own]]),
        triangles=np.concatenate([upper.triangles, lower.triangles]),
        triangle_parts=upper.triangle_parts | {"lower": m + np.arange(m)},
    )


def ruled(
    profiles: Sequence[np.ndarray],
    strips: int | Sequence[int] = 1,
    stations: int | None = None,
    diagonals: str = "crossed",
    order: int = 1,
) -> TriangleMesh:
    """The surface of straight rulings between neighbouring `profiles`, two or more polylines (p,3) m.

    Between two profiles stand `strips` rows of cells, the same everywhere or one number a gap. Rulings join points of
    the same place in their profiles, which need equal numbers of points, or those of the same share of arc length where
    `stations`, a number of cells along every profile, is given. Points that meet become one node: of closed profiles
    first and last, of a profile that is a single point all. Normals are those of (profile to profile) x (along a
    profile). Parts: the triangles "gap_1" ... one after the other; the lines "profile_1" ..., and "first" and "last",
    the outermost rulings.
    """
    given = [np.asarray(p, dtype=float) for p in profiles]
    if len(given) < 2:
        raise ValueError("a ruled surface needs two profiles or more.")
    if stations is not None:
        _counts(stations=stations)
        given = [_resampled(p, np.linspace(0.0, 1.0, stations + 1)) for p in given]
    sizes = [len(p) for p in given]
    if len(set(sizes)) > 1 or sizes[0] < 2:
        shown = ", ".join(map(str, sizes))
        raise ValueError(f"profiles have {shown} points; give all the same number, two or more, or say stations.")
    rows = [strips] * (len(given) - 1) if isinstance(strips, int) else list(strips)
    if len(rows) != len(given) - 1:
        raise ValueError(f"strips has {len(rows)} numbers for {len(given) - 1} gaps between profiles; give one a gap.")
    _counts(strips=min(rows))
    layers = [given[0][None]]
    for one, other, count in zip(given[:-1], given[1:], rows, strict=True):
        f = np.linspace(0.0, 1.0, count + 1)[1:, None, None]
        layers.append((1.0 - f) * one + f * other)
    nodes, index, triangles = _grid(np.concatenate(layers), diagonals)
    at = np.cumsum([0, *rows])
    lines = {f"profile_{k + 1}": index[row] for k, row in enumerate(at)} | {"first": index[:, 0], "last": index[:, -1]}
    each = len(triangles) // int(at[-1])
    parts = {f"gap_{k + 1}": np.arange(at[k] * each, at[k + 1] * each) for k in range(len(rows))}
    mesh = _finished(nodes, triangles, parts, lines, {}, order, label="ruled surface")
    return welded(mesh, CLOSE * float(np.ptp(nodes, axis=0).max()))


def _resampled(points, share):
    """Points (s,3) at shares of the arc length of a polyline (p,3); all the same of one without length."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.stack([np.interp(share * length[-1], length, points[:, k]) for k in range(3)], axis=1)


def cylinder(
    radius: float,
    length: float,
    cells: tuple[int, int],
    caps: bool = True,
    share: str = "whole",
    diagonals: str = "crossed",
    order: int = 1,
) -> TriangleMesh:
    """A circular cylinder around the x axis from 0 to `length` m, of `cells` along and around it, normals outward.

    With `caps` its ends are closed by discs, whose rims are the cells around it: a multiple of 4, 6 or 10. `share`
    "half" is the half with y >= 0, of half the cells around. Parts: the triangles "wall", "cap_start" at x = 0 and
    "cap_end"; the lines "start" and "end", its rims, and of a half "symmetry_y".
    """
    _positive(radius=radius, length=length)
    _counts(cells=min(cells))
    half = _one_of("share", share, {"whole": False, "half": True})
    along, around = cells
    if half and around % 2:
        raise ValueError("half a cylinder needs an even number of cells around the whole one.")
    if around < 4:
        raise ValueError("a cylinder needs four cells around it or more.")
    turn = np.pi if half else 2.0 * np.pi
    flat = rectangle(length, turn, (along, around // 2 if half else around), diagonals, order)
    names = {"start": ("x_min",), "end": ("x_max",)} | ({"symmetry_y": ("y_min", "y_max")} if half else {})
    wall = replace(
        flat,
        nodes=_rolled(flat.nodes, radius),
        triangle_parts={"wall": flat.triangle_parts["sheet"]},
        line_parts={name: flat.lines_of(*of) for name, of in names.items()},
        point_parts={},
        label="cylinder",
    )
    if not half:  # the seam is none: without its lines
        wall = _only_lines(wall, wall.lines_of("start", "end"))
    ends = _caps(radius, length, around, share, order) if caps else []
    return joined([wall, *ends], CLOSE * max(radius, length))


def _rolled(nodes, radius):
    """Places (n,3) on a cylinder around x of points (x, angle from z towards y)."""
    y, z = radius * np.sin(nodes[:, 1]), radius * np.cos(nodes[:, 1])
    clean = [np.where(np.abs(v) < 1e-12 * radius, 0.0, v) for v in (y, z)]
    return np.stack([nodes[:, 0], *clean], axis=1)


def _caps(radius, length, around, share, order):
    sectors = next((s for s in _SECTORS if around % s == 0), 0)
    if not sectors:
        raise ValueError(f"a cylinder with caps needs a multiple of 4, 6 or 10 cells around it; it has {around}.")
    flat = disc(radius, around // sectors, sectors, share, order)
    found = []
    for name, x in (("start", 0.0), ("end", length)):
        lines = {"rim": name, "symmetry_y": "symmetry_y"}
        cap = replace(
            flat,
            nodes=np.stack([np.full(len(flat.nodes), x), flat.nodes[:, 1], flat.nodes[:, 0]], axis=1),
            triangle_parts={f"cap_{name}": flat.triangle_parts["disc"]},
            line_parts={lines[k]: rows for k, rows in flat.line_parts.items()},
            point_parts={f"centre_{name}": flat.point_parts["centre"]},
        )
        found.append(turned(cap, np.arange(len(cap.triangles))) if name == "end" else cap)
    return found


def sphere(radius: float, cells: int, share: str = "whole", order: int = 1) -> TriangleMesh:
    """A sphere around the origin of eight octants with `cells`^2 triangles each, normals outward.

    `share` "eighth" is the octant with x, y, z >= 0. Parts: the triangles "sphere"; of an eighth the lines
    "symmetry_x", "symmetry_y", "symmetry_z" in the planes x = 0, y = 0, z = 0; the points "pole_x", "pole_y", "pole_z".
    """
    _positive(radius=radius)
    _counts(cells=cells)
    eighth = _one_of("share", share, {"whole": False, "eighth": True})
    i, j = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    inside = i + j <= cells
    index = np.full(i.shape, -1)
    index[inside] = np.arange(inside.sum())
    weights = np.stack([cells - i - j, i, j], axis=2)[inside]
    nodes = radius * weights / np.linalg.norm(weights, axis=1, keepdims=True)
    low = index[:-1, :-1][inside[1:, :-1]], index[1:, :-1][inside[1:, :-1]], index[:-1, 1:][inside[1:, :-1]]
    up = inside[1:, 1:]
    high = index[1:, :-1][up], index[1:, 1:][up], index[:-1, 1:][up]
    triangles = np.concatenate([np.stack(low, axis=1), np.stack(high, axis=1)])
    k = np.arange(cells + 1)
    sides = {"symmetry_x": index[cells - k, k], "symmetry_y": index[0], "symmetry_z": index[:, 0]}
    points = {"pole_x": index[[0], [0]], "pole_y": index[[-1], [0]], "pole_z": index[[0], [-1]]}

    def outside(middle, ends):
        return radius * middle / np.linalg.norm(middle, axis=1, keepdims=True)

    parts = {"sphere": np.arange(len(triangles))}
    mesh = _finished(nodes, triangles, parts, sides if eighth else {}, points, order, outside, label="sphere")
    for axis in () if eighth else range(3):
        mesh = joined([mesh, mirrored(mesh, axis)], CLOSE * radius)
    return mesh


def rolled_cylinder(
    length: float, width: float, cells: tuple[int, int], diagonals: str = "crossed", order: int = 1
) -> tuple[TriangleMesh, np.ndarray]:
    """A flat rectangle of `length` by `width` m wound around the x axis until its long sides meet, as a mesh and the
    pattern (m,3|6,2) m that its triangles have in the rectangle, of `cells` along and around.

    The cells around stay flat faces of a prism, so nothing is strained, whatever their number. Parts as of `cylinder`
    without caps.
    """
    flat = rectangle(length, width, cells, diagonals, order)
    around = cells[1]
    if around < 4:
        raise ValueError("a cylinder needs four cells around it or more.")
    corner_angle = 2.0 * np.pi / around
    radius = 0.5 * width / around / np.sin(0.5 * corner_angle)
    place = flat.nodes[:, 1] * (around / width)
    face = np.minimum(np.floor(place + CLOSE), around - 1)
    share = (place - face)[:, None]
    one, other = (_rolled(np.stack([flat.nodes[:, 0], a], axis=1), radius) for a in (
        face * corner_angle, (face + 1.0) * corner_angle
    ))  # fmt: skip
    mesh = replace(
        flat,
        nodes=(1.0 - share) * one + share * other,
        triangle_parts={"wall": flat.triangle_parts["sheet"]},
        line_parts={"start": flat.line_parts["x_min"], "end": flat.line_parts["x_max"]},
        point_parts={},
        label="rolled cylinder",
    )
    pattern = flat.nodes[flat.triangles][:, :, :2]
    return welded(_only_lines(mesh, mesh.lines_of("start", "end")), CLOSE * max(length, width)), pattern


def _only_lines(mesh: TriangleMesh, rows: np.ndarray) -> TriangleMesh:
    place = np.full(len(mesh.lines), -1)
    place[rows] = np.arange(len(rows))
    parts = {name: np.sort(place[of]) for name, of in mesh.line_parts.items()}
    return replace(mesh, lines=mesh.lines[rows], line_parts=parts, line_numbers=1 + np.arange(len(rows)))


def _grid(points, diagonals):
    """Nodes (n,3) m, the indices (p,q) of the grid points among them, and the triangles of points (p,q,3) m, cell by
    cell along the first axis, then the second.
    """
    if diagonals not in DIAGONALS:
        raise ValueError(f"diagonals cannot be '{diagonals}'; choose one of: {', '.join(DIAGONALS)}.")
    p, q = points.shape[:2]
    nodes, index = points.reshape(-1, 3), np.arange(p * q).reshape(p, q)
    a, b, c, d = (g.ravel() for g in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    if diagonals == "crossed":
        e = p * q + np.arange(len(a))
        nodes = np.concatenate([nodes, 0.25 * (nodes[a] + nodes[b] + nodes[c] + nodes[d])])
        return nodes, index, np.stack([a, b, e, b, c, e, c, d, e, d, a, e], axis=1).reshape(-1, 3)
    first = np.ones(len(a), dtype=bool)  # along a-c
    if diagonals == "union-jack":
        first = (np.add.outer(np.arange(p - 1), np.arange(q - 1)) % 2 == 0).ravel()
    elif diagonals == "shorter":
        one, other = (np.linalg.norm(nodes[k] - nodes[l], axis=1) for k, l in ((a, c), (b, d)))
        first = one <= other * (1.0 + CLOSE)
    along, across = np.stack([a, b, c, a, c, d], axis=1), np.stack([a, b, d, b, c, d], axis=1)
    return nodes, index, np.where(first[:, None], along, across).reshape(-1, 3)


def _finished(nodes, triangles, parts: Parts, sides, points: Parts, order, project=None, *, label):
    """The mesh with lines along `sides`, name -> the nodes in a row, of the wanted order."""
    if order not in (1, 2):
        raise ValueError(f"the order of triangles is 1 or 2, not {order}.")
    lines = [np.stack([row[:-1], row[1:]], axis=1) for row in sides.values()]
    ends = np.cumsum([0, *map(len, lines)])
    rows = {name: np.arange(ends[k], ends[k + 1]) for k, name in enumerate(sides)}
    every = np.concatenate([np.zeros((0, 2), dtype=int), *lines])
    mesh = TriangleMesh(nodes, triangles, every, parts, rows, points, label)
    return quadratic(mesh, project) if order == 2 else mesh


def _positive(**sizes):
    for name, size in sizes.items():
        if not 0.0 < size < np.inf:
            raise ValueError(f"{name} must be a finite number above zero; it is {size:g}.")


def _counts(**counts):
    for name, count in counts.items():
        if count < 1 or count != int(count):
            raise ValueError(f"{name} must be whole numbers of 1 or more; there is {count}.")


def _one_of(name, value, choices):
    if value not in choices:
        raise ValueError(f"{name} cannot be '{value}'; choose one of: {', '.join(choices)}.")
    return choices[value]
