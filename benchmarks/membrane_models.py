"""Meshes and models of membranes that benchmarks and tests share."""

import numpy as np

from structural import Assembly, FaceLoad, Faces, Loads, Structure, equilibrium
from structural.elements.membranes import Membranes, flat_patterns
from structural.materials.membranes import isotropic_membrane

AIRBAG_FABRIC = 588e6, 0.6e-3, 0.4  # modulus Pa, thickness m, Poisson's ratio (ram-air thesis, table 3.2)


def rectangle(cells, sides, crossed=False):
    """Nodes (n,3) and triangles (e,3) of a rectangle with (nx, ny) cells, cut in two, or in four through their
    centre.
    """
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
    """Nodes and triangles of a disc: ring k has 6 k nodes, 6 rings^2 triangles in all; the last 6 `rings` are the
    edge.
    """
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
    """The same triangles with a node in the middle of every side: nodes, triangles (e,6), and the pairs of nodes that
    each new node lies between.
    """
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs, place = np.unique(sides, axis=0, return_inverse=True)
    middles = 0.5 * (nodes[pairs[:, 0]] + nodes[pairs[:, 1]])
    six = np.hstack([triangles, len(nodes) + place.reshape(-1, 3)])
    return np.concatenate([nodes, middles]), six, pairs


def isotropic(nodes, triangles, stiffness, nu, wrinkles=True, pattern=None):
    """Membranes of E h `stiffness` N/m and Poisson's ratio `nu`, without stress in `pattern` or where the nodes are."""
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


def airbag(n, half=0.422, stiffness=AIRBAG_FABRIC[0] * AIRBAG_FABRIC[1], nu=AIRBAG_FABRIC[2], wrinkles=True):
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


def hencky(rings, q, nu, m=3):
    """Disc of radius 1 m and E h 1 N/m, held at its edge, in equilibrium under the pressure q = p a / (E h): the
    result, the membranes and the loads. Node 0 is the centre.
    """
    nodes, triangles = disc(rings)
    held = np.arange(len(nodes)) >= len(nodes) - 6 * rings
    if m == 6:
        nodes, triangles, pairs = quadratic(nodes, triangles)
        edge = held[pairs].all(axis=1) & (np.abs(np.diff(pairs, axis=1)[:, 0]) != 0)
        outer = np.linalg.norm(nodes[len(held) :], axis=1) > 1.0 - 1.0 / rings
        edge &= outer
        nodes[len(held) :][edge] /= np.linalg.norm(nodes[len(held) :][edge], axis=1)[:, None]
        held = np.concatenate([held, edge])
    group = isotropic(nodes, triangles, 1.0, nu)
    found, _, loads = inflated(nodes, np.repeat(held[:, None], 3, axis=1), group, q)
    return found, group, loads


def octant(n, radius=1.0):
    """Nodes, triangles (n^2) and flat places on the plane x + y + z = 1 of an eighth of a sphere."""
    number = {}
    for i in range(n + 1):
        for j in range(n + 1 - i):
            number[i, j] = len(number)
    flat = np.array([[i, j, n - i - j] for i, j in number]) / n
    triangles = [[number[i, j], number[i + 1, j], number[i, j + 1]] for i in range(n) for j in range(n - i)]
    triangles += [
        [number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]] for i in range(n) for j in range(n - i - 1)
    ]
    return radius * flat / np.linalg.norm(flat, axis=1)[:, None], np.array(triangles), flat


def tube(around, along, radius=0.1, half=0.3, stiffness=4e6, nu=0.3, m=6):
    """Half the circumference and half the length of an inflated tube with a rigid end plate, whose centre is the last
    node and has the one nodal rotation: structure with the load groups "skin" and "cap". x along the tube, z across,
    away from the side that a negative moment about y presses.

    x = 0 and y = 0 are planes of symmetry.
    """
    sheet, triangles = rectangle((along, around), (half, np.pi))
    if m == 6:
        sheet, triangles, _ = quadratic(sheet, triangles)
    angle, n = sheet[:, 1], len(sheet)
    nodes = np.column_stack([sheet[:, 0], radius * np.sin(angle), -radius * np.cos(angle)])
    nodes = np.concatenate([nodes, [[half, 0.0, 0.0]]])
    outward = [0, 2, 1] if m == 3 else [0, 2, 1, 5, 4, 3]
    triangles = triangles[:, outward]
    ring = np.flatnonzero(np.isclose(sheet[:, 0], half))
    ring = ring[np.argsort(angle[ring])]
    fixed = np.zeros(nodes.shape, bool)
    fixed[:n, 0] = np.isclose(sheet[:, 0], 0.0)
    fixed[:n, 1] = np.isclose(np.sin(angle), 0.0, atol=1e-9)
    fixed[np.flatnonzero(np.isclose(sheet[:, 0], 0.0) & np.isclose(angle, 0.0)), 2] = True
    fixed[n, 1] = True
    cap = np.stack([ring[:-1], ring[1:], np.full(len(ring) - 1, n)], axis=1)
    normal = np.cross(nodes[cap[0, 1]] - nodes[cap[0, 0]], nodes[n] - nodes[cap[0, 0]])
    cap = cap if normal[0] > 0.0 else cap[:, [1, 0, 2]]
    return Structure(
        nodes,
        fixed,
        (isotropic(nodes, triangles, stiffness, nu),),
        {"skin": Faces(triangles), "cap": Faces(cap)},
        rotation_nodes=np.array([n]),
        fixed_rotations=np.array([[True, False, True]]),
        dependent_nodes=ring,
        link_rotations=np.zeros(len(ring), dtype=int),
    )
