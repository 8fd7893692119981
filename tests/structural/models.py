"""Structures and differences that the tests of this folder share."""

import numpy as np
import scipy.sparse as sp

from structural import Chains, Loads, Structure, interface_groups, interface_loads

MIRROR = np.array([1.0, -1.0, 1.0])

# Step of central differences on coordinates of about 1 m. Truncation is h^2 f'''/6, about 1e-12 of the tangent on
# members of 1 m, rounding eps f / h, about 1e-10 of it; both leave the 1e-6 that is asked for a wide margin, also on
# members of 0.1 m, where truncation grows a hundredfold.
STEP = 1e-6
# Moving one unknown by h moves at most both ends of a leg and both neighbours of a sheave: a rope changes by less than
# this many steps, so a state whose stretches all lie further from zero meets no slack kink between its samples.
KINK = 8.0 * STEP
TANGENT_TOLERANCE = 1e-6  # ten times what the differences above leave; relative to the largest entry of the tangent


def central_difference(f, x, h=STEP):
    """Derivative (outputs, inputs) of f at x by central differences."""
    columns = []
    for i in range(x.size):
        e = np.zeros(x.size)
        e[i] = h
        columns.append((np.ravel(f(x + e.reshape(x.shape))) - np.ravel(f(x - e.reshape(x.shape)))) / (2.0 * h))
    return np.array(columns).T


def chains(nodes, l0, k, two_way=False):
    """Chains with the same stiffness and kind for all elements, names left out."""
    nodes = np.atleast_2d(nodes)
    e = len(nodes)
    return Chains(
        nodes,
        np.broadcast_to(l0, e).astype(float),
        np.broadcast_to(k, e).astype(float),
        np.broadcast_to(two_way, e).copy(),
    )


def structure(nodes, fixed, groups, surface=None, panels=None, lines=None):
    """Structure without a surface unless one is given; `fixed` may be one flag a node."""
    nodes = np.asarray(nodes, float)
    fixed = np.asarray(fixed, bool)
    fixed = np.repeat(fixed[:, None], 3, axis=1) if fixed.ndim == 1 else fixed
    panels = np.zeros((0, 4), dtype=int) if panels is None else np.asarray(panels)
    lines = None if lines is None else np.asarray(lines)
    loaded = {} if surface is None else interface_groups(sp.csr_array(surface), panels, lines)
    return Structure(nodes, fixed, tuple(groups), loaded)


def dead(weight):
    """Loads that are nodal forces (n,3) N only."""
    return Loads(np.asarray(weight, float))


def lengths(x, nodes):
    """Lengths m of chains with nodes (e,m) along their legs."""
    return np.linalg.norm(np.diff(x[nodes], axis=1), axis=2).sum(axis=1)


def clear_of_kinks(x, groups):
    """Whether no tension-only element is so near its rest length that a difference step crosses it."""
    return all(np.all(c.two_way | (np.abs(lengths(x, c.nodes) - c.l0) > KINK)) for c in groups)


def residual_of(assembly, groups, loads):
    """The residual as a function of the unknowns, and the prepared loads."""
    prepared = assembly.prepare(loads, groups)
    return (lambda q: assembly.residual(q, prepared)[0]), prepared


def random_mirrored(rng, pairs=6, in_plane=3):
    """A random mirror-symmetric structure of springs, lines and ropes over 1 to 3 sheaves, with a surface hung on it.

    The surface has quads, a triangle, panels and loaded lines that reach over the plane; its nodes are affine
    combinations of structural nodes, some with negative weights. Returns structure, loads and mirror permutation.
    """
    right = rng.uniform([-1, 0.4, -1], [1, 2, 1], (pairs, 3))
    middle = rng.uniform([-1, 0, -1], [1, 0, 1], (in_plane, 3))
    nodes = np.concatenate([right, right * MIRROR, middle])
    n = len(nodes)
    mirror = np.concatenate([np.arange(pairs, 2 * pairs), np.arange(pairs), np.arange(2 * pairs, n)])
    groups = [_mirrored_chains(rng, nodes, mirror, size, count) for size, count in ((2, 9), (3, 5), (4, 3), (5, 2))]
    fixed = np.zeros((n, 3), bool)
    fixed[[0, pairs]] = True
    fixed[1, 2] = fixed[pairs + 1, 2] = True
    fixed[2 * pairs, 0] = True
    return *_with_surface(rng, nodes, fixed, groups, mirror, pairs), mirror


def _mirrored_chains(rng, nodes, mirror, size, count):
    """`count` random elements of `size` nodes and their images, each once, half of them slack."""
    rows, l0, k, two_way = [], [], [], []
    used = set()
    while len(used) < count:
        row = rng.choice(len(nodes), size, replace=False)
        image = mirror[row]
        key = min(tuple(sorted(row)), tuple(sorted(image)))
        itself = np.array_equal(np.sort(row), np.sort(image))
        if key in used or (itself and not (np.array_equal(row, image) or np.array_equal(row, image[::-1]))):
            continue
        used.add(key)
        values = rng.uniform(0.6, 1.2) * lengths(nodes, row[None])[0], rng.uniform(50.0, 500.0), rng.random() < 0.4
        for r in [row] if itself else [row, image[::-1]]:
            rows.append(r)
            for to, value in zip((l0, k, two_way), values, strict=True):
                to.append(value)
    return Chains(np.array(rows), np.array(l0), np.array(k), np.array(two_way))


def _with_surface(rng, nodes, fixed, groups, mirror, pairs):
    n = len(nodes)
    half = np.zeros((5, n))
    for row in half:
        of = rng.choice(n, 4, replace=False)
        row[of] = rng.uniform(-0.3, 1.0, 4)
        row /= row.sum()
    surface = np.concatenate([half, half[:, mirror], np.eye(n)[2 * pairs : 2 * pairs + 2]])
    quads = np.array([[0, 1, 2, 3], [1, 4, 2, 2], [0, 3, 4, 10]])
    image = np.concatenate([np.arange(5, 10), np.arange(5), [10, 11]])
    across = np.array([[0, 5, 6, 1]])
    panels = np.concatenate([quads, image[quads[:, [0, 3, 2, 1]]], across])
    p = rng.uniform(-200, 200, 3)
    s = rng.uniform(-100, 100, (3, 3))
    pressure = np.concatenate([p, p, rng.uniform(-200, 200, 1)])
    shear = np.concatenate([s, s * MIRROR, rng.uniform(-100, 100, (1, 3)) * [1, 0, 1]])
    legs = np.array([[0, 4], [2, 10]])
    lines = np.concatenate([legs, image[legs], [[1, 6]]])
    w = np.array([[50.0, -20.0, 30.0], [-40.0, 35.0, 10.0]])
    line_load = np.concatenate([w, w * MIRROR, [[25.0, 0.0, -45.0]]])
    # the image of a triangle (a, b, c, c) listed backwards is (a, c, c, b): collapsed at another corner, same panel
    loads = Loads(np.zeros_like(nodes), interface_loads(pressure, shear, line_load))
    return structure(nodes, fixed, groups, surface, panels, lines), loads
