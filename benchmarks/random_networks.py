"""Random structures that have an equilibrium, made to be hard for a static solver; (kind, seed) -> plain arrays.

It is there by convexity: where nothing but lines and ropes pulls, every free node is tied to a support and loads are
dead, the energy is convex and grows in every direction. With springs that may push too it still has a minimum. Or it is
there by construction: a stressed shape is chosen, and the loads are those that balance it.
"""

from dataclasses import dataclass

import numpy as np

# N: stiffness EA of what is in the middle, and a load; both are spread from there.
STIFFNESS, LOAD = 1e5, 10.0
DECADES = (0.0, 2.0, 6.0, 10.0, 15.0)  # between the least and the largest EA of a network


@dataclass(frozen=True, eq=False)
class Members:
    """Elements with m nodes each: `nodes` (e,m), rest lengths `l0` (e,) m, stiffness `k` (e,) N/m, `two_way` (e,)."""

    nodes: np.ndarray
    l0: np.ndarray
    k: np.ndarray
    two_way: np.ndarray


@dataclass(frozen=True, eq=False)
class Network:
    """Reference nodes (n,3) m, `held` (n,), members, dead `loads` (n,3) N and where to `start` (n,3) m."""

    nodes: np.ndarray
    held: np.ndarray
    members: tuple[Members, ...]
    loads: np.ndarray
    start: np.ndarray


def lengths(x, nodes):
    """Lengths (e,) m over all legs."""
    return np.linalg.norm(np.diff(x[nodes], axis=1), axis=2).sum(axis=1)


def _ties(rng, n, held, more):
    """Pairs of nodes that tie every node to a held one, and `more` others."""
    order = np.concatenate([np.flatnonzero(held), rng.permutation(np.flatnonzero(~held))])
    first = held.sum()
    pairs = [(order[rng.integers(0, i)], order[i]) for i in range(first, n)]
    pairs += [tuple(rng.choice(n, 2, replace=False)) for _ in range(more)]
    return np.array(pairs)


def _stiffness(rng, l0, decades):
    exponent = rng.uniform(-0.5, 0.5, len(l0)) * decades
    return STIFFNESS * 10.0**exponent / l0


def _some_loads(rng, held, size):
    n = len(held)
    loads = np.where(rng.random((n, 1)) < rng.uniform(0.2, 1.0), rng.normal(size=(n, 3)), 0.0)
    if rng.random() < 0.5:  # weight
        loads[:, 2] -= rng.uniform(0.0, 3.0)
    return np.where(held[:, None], 0.0, size * loads)


def _rope_nodes(rng, n, count):
    """Nodes of ropes over one to three sheaves, groups of equal number."""
    sheaves = rng.integers(1, 4, count)
    return [np.array([rng.choice(n, m + 2, replace=False) for _ in range(c)]) for m, c in
            ((m, int(np.count_nonzero(sheaves == m))) for m in (1, 2, 3)) if c and n >= m + 2]  # fmt: skip


def _net(rng, size, pushing):
    n = int(np.exp(rng.uniform(np.log(5.0), np.log(200.999))))
    nodes = size * rng.uniform(-1.0, 1.0, (n, 3))
    held = np.zeros(n, bool)
    held[rng.choice(n, max(3, n // 6), replace=False)] = True
    decades = rng.choice(DECADES)
    pairs = _ties(rng, n, held, int(rng.integers(0, 2 * n)))
    groups = [pairs, *_rope_nodes(rng, n, int(rng.integers(0, 1 + n // 8)))]
    members = []
    for rows in groups:
        l0 = rng.uniform(0.7, 1.4, len(rows)) * lengths(nodes, rows)
        two_way = rng.random(len(rows)) < pushing if rows.shape[1] == 2 else np.zeros(len(rows), bool)
        members.append(Members(rows, l0, _stiffness(rng, l0, decades), two_way))
    loads = _some_loads(rng, held, LOAD * 10.0 ** rng.uniform(-3.0, 6.0))
    start = np.where(held[:, None], nodes, nodes + size * rng.choice([0.0, 0.1, 1.0]) * rng.normal(size=(n, 3)))
    return Network(nodes, held, tuple(members), loads, start)


def net(rng):
    """Lines and ropes under dead loads, of 1 to 1e4 m."""
    return _net(rng, 10.0 ** rng.uniform(0.0, 4.0), 0.0)


def large(rng):
    """The same, of 3 to 30 km."""
    return _net(rng, 10.0 ** rng.uniform(3.5, 4.5), 0.0)


def springs(rng):
    """Half of the lines may push."""
    return _net(rng, 10.0 ** rng.uniform(0.0, 4.0), 0.5)


def built(rng):
    """Lines and ropes, all taut in a shape whose loads balance it; the start is elsewhere."""
    drawn = _net(rng, 10.0 ** rng.uniform(0.0, 4.0), 0.0)
    loads, members = np.zeros_like(drawn.nodes), []
    level = LOAD * 10.0 ** rng.uniform(-3.0, 6.0)
    for group in drawn.members:
        length = lengths(drawn.nodes, group.nodes)
        pull = level * 10.0 ** rng.uniform(-1.0, 1.0, len(length))
        ea = np.maximum(group.k * group.l0, 0.1 * pull)  # stretched to eleven times its length at most
        l0 = length / (1.0 + pull / ea)
        members.append(Members(group.nodes, l0, ea / l0, group.two_way))
        legs = np.diff(drawn.nodes[group.nodes], axis=1)
        legs = pull[:, None, None] * legs / np.linalg.norm(legs, axis=2)[..., None]
        for i in range(legs.shape[1]):
            np.add.at(loads, group.nodes[:, i], -legs[:, i])
            np.add.at(loads, group.nodes[:, i + 1], legs[:, i])
    return Network(drawn.nodes, drawn.held, tuple(members), np.where(drawn.held[:, None], 0.0, loads), drawn.start)


def cable(rng):
    """A long row of short stiff elements between two supports, with its weight and a few loads."""
    n = int(rng.integers(60, 501))
    span = 10.0 ** rng.uniform(1.0, 3.5)
    chord = np.array([1.0, 0.0, rng.uniform(-0.5, 0.5)])
    t = np.linspace(0.0, 1.0, n + 1)[:, None]
    nodes = span * t * chord + 10.0 ** rng.uniform(0.0, 3.0) * rng.normal(size=3)
    rows = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    l0 = rng.uniform(0.95, 1.3) * lengths(nodes, rows)
    ea = 10.0 ** rng.uniform(4.0, 9.0)
    held = np.zeros(n + 1, bool)
    held[[0, -1]] = True
    loads = np.zeros_like(nodes)
    loads[:, 2] = -(10.0 ** rng.uniform(-2.0, 2.0)) * span / n
    for node in rng.integers(1, n, rng.integers(0, 4)):
        loads[node] += abs(loads[1, 2]) * n * rng.normal(size=3)
    sag = np.zeros_like(nodes)
    sag[:, 2] = -span * rng.choice([0.0, 0.01, 0.3]) * 4.0 * (t * (1.0 - t))[:, 0]
    start = nodes + sag
    if rng.random() < 0.3:
        start = start + 0.2 * span * rng.normal(size=nodes.shape)
    elif rng.random() < 0.3:
        start = nodes[0] + 0.3 * (nodes - nodes[0])  # in a heap at one end
    start = np.where(held[:, None], nodes, start)
    loads[held] = 0.0
    return Network(nodes, held, (Members(rows, l0, ea / l0, np.zeros(n, bool)),), loads, start)


KINDS = {"net": net, "large": large, "springs": springs, "built": built, "cable": cable}


def random_network(kind, seed):
    """The network of a kind (see `KINDS`) with this seed."""
    return KINDS[kind](np.random.default_rng([list(KINDS).index(kind), seed]))
