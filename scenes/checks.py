"""What looks odd in a structure that can be solved all the same: hints for runs that end badly."""

import numpy as np

from interface.mirror import MIRROR, mirror_permutation
from structural.dofs import rotation_images

from .cores.symmetry import unlike

PRESTRAIN = 0.05  # over the rest length, in the reference configuration
COINCIDENT = 1e-6  # m, as for mirror images
ROUNDING = 1e-9  # of masses, relative


def prestrained(nodes, chains):
    """Elements whose strain at the nodes (n,3) m is more than PRESTRAIN, slack ones too, as texts."""
    found = []
    for group in chains:
        length = np.linalg.norm(np.diff(nodes[group.nodes], axis=1), axis=2).sum(axis=1)
        off = np.flatnonzero((group.l0 > 0.0) & (np.abs(length - group.l0) > PRESTRAIN * group.l0))
        found += [f"{group.names[e]} has {group.l0[e]:.3f} m for {length[e]:.3f} m" for e in off]
    return found


def free_line_ends(members):
    """Lines that end in a node, not wholly fixed, to which nothing else is joined: pairs of element and node."""
    joined = np.zeros(len(members.nodes), dtype=int)
    for group in members.chains:
        np.add.at(joined, group.nodes, 1)
    ends = np.concatenate([np.zeros((0, 2), dtype=int), *(group.nodes[:, [0, -1]] for group in members.chains)])
    if members.membranes is not None:
        np.add.at(joined, members.membranes.group.nodes, 1)
    if members.wing is not None:
        joined[members.wing.tubes.ends] += 1
        joined[members.wing.dependent_nodes] += 1
    free = (members.area > 0.0)[:, None] & (joined[ends] == 1) & ~members.fixed[ends].all(axis=2)
    return [(int(e), int(ends[e, side])) for e, side in np.argwhere(free)]


def bare_line_ends(members, loads, density):
    """Free line ends without a load of the table and without more than half the mass of the line, `density` kg/m^3 that
    of lines, as texts: hanging ropes, or lines that were to be joined to something.
    """
    loaded = {int(n) for load in loads for n in load.nodes}
    length = np.concatenate([np.zeros(0), *(group.l0 for group in members.chains)])
    found = []
    for e, n in free_line_ends(members):
        own = 0.5 * density * members.area[e] * length[e]
        if n not in loaded and members.mass[n] <= own * (1.0 + ROUNDING):
            found.append(f"{members.names[e]} at node {members.labels[n]}")
    return found


def asymmetry(members, groups):
    """The first thing that keeps a structure from being its own mirror image in y = 0, as text; empty if nothing."""
    nodes, labels = members.nodes, members.labels
    image = mirror_permutation(nodes)
    if image is None:
        flipped = nodes * MIRROR
        distance = np.linalg.norm(nodes[:, None] - flipped[None], axis=2)
        gap = distance.min(axis=1)
        worst = int(np.argmax(gap))
        if gap[worst] > COINCIDENT:
            return f"node {labels[worst]} has no mirror image; the nearest is {gap[worst]:.2g} m off"
        there, here = (
            np.count_nonzero(np.linalg.norm(nodes[:, None] - p, axis=2) < COINCIDENT, axis=1) for p in (flipped, nodes)
        )
        return f"at node {labels[int(np.argmax(np.abs(here - there)))]} there are more nodes than at its mirror image"
    odd = np.flatnonzero(np.any(members.fixed != members.fixed[image], axis=1))
    if len(odd):
        return f"nodes {labels[odd[0]]} and {labels[image[odd[0]]]} are not held alike"
    rotation_nodes = np.zeros(0, dtype=int) if members.wing is None else members.wing.rotation_nodes
    try:
        rotations = rotation_images(rotation_nodes, image)
    except ValueError:
        return "the rotation of a tube end has no mirror image"
    for group in groups:
        rows = group.images(image, rotations)
        if np.any(rows < 0):
            return f"element {group.label(int(np.argmin(rows)))} has no mirror image"
        for what, values in group.properties().items():
            odd = np.flatnonzero(unlike(values, values[rows]).reshape(len(rows), -1).any(axis=1))
            if len(odd):
                e, i = odd[0], rows[odd[0]]
                one, two = (np.array2string(values[k], precision=12) for k in (e, i))
                return f"{what} of {group.label(e)} is {one}, of {group.label(i)} {two}"
    odd = np.flatnonzero(np.abs(members.mass - members.mass[image]) > ROUNDING * members.mass.max(initial=0.0))
    if len(odd):
        a, b = odd[0], image[odd[0]]
        return f"mass at node {labels[a]} is {members.mass[a]:.6g} kg, at node {labels[b]} {members.mass[b]:.6g} kg"
    return ""
