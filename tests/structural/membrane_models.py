"""Meshes and models of membranes that tests share."""

import numpy as np

from structural import Assembly, FaceLoad, Faces, Loads, Structure, equilibrium
from structural.elements.membranes import Membranes, flat_patterns
from structural.materials.membranes import isotropic_membrane


def rectangle(cells, sides, crossed=False):
    """Nodes (n,3) and triangles (e,3) of a rectangle with (nx, ny) cells, cut in two, or in four through their centre."""
    (nx, ny), (a, b) = cells, sides
    x, y = np.meshgrid(np.linspace(0.0, a, nx + 1), np.linspace(0.0, b, ny + 1), indexing="ij")
    corner = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)).reshape(-1)
    p, q, r, s = corner, corner + ny + 1, corner + ny + 2, corner + 1
    nodes = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    if not crossed:
        return nodes, np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    centres = 0.25 * (nodes[p] + nodes[q] + nodes[r] + nodes[s])
    m = len(nodes) + np.arange(len(p))
    sides = [np.stack(t, axis=1) for t in ((p, q, m), (q, r, m), (r, s, m), (s, p, m))]
    return np.concatenate([nodes, centres]), np.concatenate(sides)


def disc(rings, radius=1.0):
    """Nodes and triangles of a disc: ring k has 6 k nodes, 6 rings^2 triangles in all; the last 6 `rings` are the edge."""
    nodes, triangles = [np.zeros((1, 3))], []
    start = [0]
    for k in range(1, rings + 1):
        angle = np.arange(6 * k) * (np.pi / (3 * k))
        ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(6 * k)]) * (radius * k / rings)
        start.append(start[-1] + max(6 * (k - 1), 1))
        nodes.append(ring)
    for k in range(1, rings + 1):
        for sector in range(6):
            for i in range(k):
                a, b = sector * k + i, (sector * k + i + 1) % (6 * k)
                c = (sector * (k - 1) + i) % max(6 * (k - 1), 1)
                triangles.append([start[k] + a, start[k] + b, start[k - 1] + c])
                if i < k - 1:
                    d = (sector * (k - 1) + i + 1) % (6 * (k - 1))
                    triangles.append([start[k] + b, start[k - 1] + d, start[k - 1] + c])
    return np.concatenate(nodes), np.array(triangles)


def quadratic(nodes, triangles):
    """The same triangles with a node in the middle of every side: nodes, triangles (e,6), and the pairs of nodes that each
    new node lies between."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs, place = np.unique(sides, axis=0, return_inverse=True)
    middles = 0.5 * (nodes[pairs[:, 0]] + nodes[pairs[:, 1]])
    six = np.hstack([triangles, len(nodes) + place.reshape(-1, 3)])
    return np.concatenate([nodes, middles]), six, pairs


def isotropic(nodes, triangles, stiffness, nu, wrinkles=True, pattern=None):
    """Membranes of E h `stiffness` N/m and Poisson's ratio `nu`, without stress in `pattern`, or where the nodes are."""
    e = len(triangles)
    law = isotropic_membrane(np.full(e, float(stiffness)), np.full(e, float(nu)), wrinkles)
    return Membranes(triangles, flat_patterns(nodes, triangles) if pattern is None else pattern, law)


def inflated(nodes, fixed, group, pressure, others=(), start=None, **how):
    """Equilibrium of membranes under a pressure along their normals, and its assembly."""
    s = Structure(nodes, fixed, (group, *others), {"skin": Faces(group.nodes)})
    loads = Loads(np.zeros_like(nodes), {"skin": FaceLoad(np.full(len(group), float(pressure)))})
    assembly = Assembly(s)
    how = {"atol": 0.0, "rtol": 1e-9} | how
    return equilibrium(assembly, loads, nodes if start is None else start, **how), assembly, loads


def airbag(n, half=0.422, stiffness=588e6 * 0.6e-3, nu=0.4, wrinkles=True):
    """An eighth of the square airbag (ram-air thesis 3.5.1), n x n squares cut in four: nodes, fixed, membranes.

    Node 0 is the centre M; x = 0 and y = 0 are planes of symmetry, and so is z = 0, in which the outer edges stay.
    """
    nodes, triangles = rectangle((n, n), (half, half), crossed=True)
    fixed = np.zeros(nodes.shape, bool)
    fixed[:, :2] = nodes[:, :2] < 1e-9
    fixed[:, 2] = np.any(nodes[:, :2] > half - 1e-9, axis=1)
    return nodes, fixed, isotropic(nodes, triangles, stiffness, nu, wrinkles)


def principal(group, x):
    """Larger and smaller principal stress N/m (2, points, e), 2nd Piola-Kirchhoff."""
    s, _ = group.law.response(group.strains(x), tangents=False)
    mean, radius = 0.5 * (s[0] + s[1]), np.hypot(0.5 * (s[0] - s[1]), s[2])
    return np.stack([mean + radius, mean - radius])
