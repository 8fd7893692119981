"""Closed surfaces with known shapes: spheres and ellipsoids of quads and of triangles, cubes, wings, mirror images."""

import numpy as np

from interface.mirror import MIRROR
from scenes.builders.profiles import naca
from scenes.builders.wings import BoxWing, Planform, mirrored_wing, span_shares

# Faces of a cube of nodes 0..7 (bit 0: x, bit 1: y, bit 2: z), counter-clockwise seen from outside.
FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
CORNERS = np.array([[-1.0 + 2.0 * (k >> axis & 1) for axis in range(3)] for k in range(8)])


def cube(n, angles=False):
    """Nodes and quads of the cube from -1 to 1 with n x n panels a face, equal or at equal `angles` from the middle."""
    s = np.linspace(-1.0, 1.0, n + 1)
    s = np.tan(0.25 * np.pi * s) if angles else s
    points, quads = [], []
    for face in FACES:
        o, a, _, b = CORNERS[list(face)]
        first = len(points) * (n + 1) ** 2
        u, v = np.meshgrid(0.5 * (s + 1.0), 0.5 * (s + 1.0), indexing="ij")
        points.append((o + u[..., None] * (a - o) + v[..., None] * (b - o)).reshape(-1, 3))
        k = first + np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
        quads.append(np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=2).reshape(-1, 4))
    every = np.concatenate(points)
    _, first, which = np.unique(np.round(every, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    return every[first], which.ravel()[np.concatenate(quads)]


def ellipsoid(n, axes=(1.0, 1.0, 1.0)):
    """Nodes and structured quads of an ellipsoid with half axes (3,): six faces of n x n panels blown up."""
    nodes, quads = cube(n, angles=True)
    return nodes / np.linalg.norm(nodes, axis=1)[:, None] * axes, quads


def triangulated(panels):
    """Two triangles of each quad, on its first diagonal."""
    a, b, c, d = panels.T
    return np.concatenate([np.stack([a, b, c, c], axis=1), np.stack([a, c, d, d], axis=1)])


def wing(panels=24, strips=6, profile="0012", caps="flat", spacing="cosine", **planform):
    """A wing of span 6 and chord 1 where `planform` does not say otherwise."""
    plan = Planform(**{"span": 6.0, "root": 1.0, "tip": 1.0, **planform})
    points = naca(profile).points(panels)
    return mirrored_wing(plan.stations(span_shares(strips, spacing)).sections(points), caps)


def box_wing(panels=24, wing_strips=5, plate_strips=2, corner_strips=2):
    """The box wing of the ram-air thesis: span 12 chords, height 0.2 of it, corners of 0.15 chords, NACA 0012."""
    box = BoxWing(12.0, 2.4, 1.0, 0.15, wing_strips, plate_strips, corner_strips)
    return box.surface(naca("0012").points(panels))


def all_triangles(surface):
    """Nodes and panels of a surface with its quads cut in two."""
    quads = surface.panels[:, 2] != surface.panels[:, 3]
    return surface.nodes, np.concatenate([triangulated(surface.panels[quads]), surface.panels[~quads]])


def turned_over(panels):
    """Panels that look to the other side."""
    flipped = panels[:, [0, 3, 2, 1]]
    triangle = panels[:, 2] == panels[:, 3]
    flipped[triangle] = panels[triangle][:, [0, 2, 1, 1]]
    return flipped


def with_image(nodes, panels):
    """Nodes and panels of a half y >= 0 and of its mirror image, joined in the plane y = 0."""
    place = np.arange(len(nodes), 2 * len(nodes))
    place[nodes[:, 1] == 0.0] = np.flatnonzero(nodes[:, 1] == 0.0)
    return np.concatenate([nodes, nodes * MIRROR]), np.concatenate([panels, turned_over(place[panels])])


def half_fin(panels=12, strips=2):
    """The half y >= 0 of a fin of NACA 0012 along z, whose nose and trailing edge are in the plane y = 0."""
    profile = naca("0012").points(2 * panels)[: panels + 1]
    profile[[0, -1], 1] = 0.0
    sheet = np.array([[[x, y, z] for x, y in profile] for z in np.linspace(2.0, 0.0, strips + 1)])
    count = panels + 1
    row = np.arange(sheet[..., 0].size).reshape(strips + 1, count)
    quads = np.stack([row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]], axis=2).reshape(-1, 4)
    nodes, faces = [sheet.reshape(-1, 3)], [quads]
    for k, over in ((0, False), (strips, True)):
        middle = sum(map(len, nodes)) + np.arange(count)
        nodes.append(sheet[k] * [1.0, 0.0, 1.0])
        cap = np.stack([row[k, :-1], row[k, 1:], middle[1:], middle[:-1]], axis=1)
        cap[0] = [row[k, 0], row[k, 1], middle[1], middle[1]]
        cap[-1] = [row[k, -2], row[k, -1], middle[-2], middle[-2]]
        faces.append(turned_over(cap) if over else cap)
    return np.concatenate(nodes), np.concatenate(faces)


def volume(nodes, panels):
    """Volume m^3 within closed panels, quads cut on their first diagonal."""
    a, b, c, d = np.moveaxis(nodes[panels], 1, 0)
    return float(np.einsum("mk,mk->", a, np.cross(b, c) + np.cross(c, d))) / 6.0
