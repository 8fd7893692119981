"""Whether the members of a structure hang together and are held: no loose ends, no part without support."""

from itertools import pairwise

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from .tables import SceneError


def check_connected(folder, structure, labels, fixed, elements, wing):
    """Every free node needs two elements, or one rope running over it: otherwise a line dangles. Whatever hangs
    together must be held somewhere.
    """
    held = np.zeros(len(labels))
    joined = [e.nodes for e in elements]
    for e in elements:
        for i, n in enumerate(e.nodes):
            held[n] += 2.0 if 0 < i < len(e.nodes) - 1 or e.two_way or e.fabric else 1.0
    if wing is not None:
        held[wing.tubes.ends] += 2.0
        held[wing.riders] += 2.0
        joined += [*map(tuple, wing.tubes.ends), *zip(wing.riders, wing.frames[wing.carriers], strict=True)]
    for n, label in enumerate(labels):
        if held[n] == 0.0 and not fixed[n].all():
            raise SceneError(
                f"{folder.name}/{structure['nodes']}: node '{label}' belongs to no element; connect or remove it."
            )
        if held[n] == 1.0 and not fixed[n].all():
            line = next(e.name for e in elements if n in e.nodes)
            where = f"{folder.name}/{structure['lines']}"
            raise SceneError(f"{where}: line '{line}' dangles at node '{label}'; connect that end or fix the node.")
    pairs = np.array([pair for nodes in joined for pair in pairwise(nodes)]).T
    graph = sp.coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(len(labels), len(labels)))
    count, part = connected_components(graph, directed=False)
    supported = np.bincount(part, fixed.any(axis=1), minlength=count) > 0.0
    for n, label in enumerate(labels):
        if not supported[part[n]] and held[n] > 0.0:
            raise SceneError(
                f"{folder.name}/{structure['nodes']}: the part with node '{label}' hangs on no fixed node; connect it "
                "to the rest or fix one of its nodes."
            )
