"""Nets for the structural solver alone."""

import numpy as np

from structural import Chains, Structure


def saddle(g, ratio, two_way):
    """The saddle net with g^2 + (g-1)^2 nodes: 10 m wide, 5 m high, springs of 10 N/m, rest length `ratio` x initial.

    Every cell centre is tied to the four corners of its cell; the edge is fixed on z = 5 m (u + v - 2 u v), which rises
    along one edge and falls along the opposite one; free nodes start at 2.5 m (LEI thesis 5.4.1).
    """
    corner = np.stack(np.meshgrid(*2 * [np.linspace(0.0, 1.0, g)], indexing="ij"), axis=-1).reshape(-1, 2)
    middle = np.stack(np.meshgrid(*2 * [(np.arange(g - 1) + 0.5) / (g - 1)], indexing="ij"), axis=-1).reshape(-1, 2)
    uv = np.concatenate([corner, middle])
    edge = np.any((uv == 0.0) | (uv == 1.0), axis=1)
    u, v = uv.T
    nodes = np.column_stack([10.0 * u, 10.0 * v, np.where(edge, 5.0 * (u + v - 2.0 * u * v), 2.5)])
    i, j = (a.ravel() for a in np.meshgrid(np.arange(g - 1), np.arange(g - 1), indexing="ij"))
    centre = g * g + i * (g - 1) + j
    springs = np.concatenate([np.stack([centre, (i + a) * g + j + b], axis=1) for a in (0, 1) for b in (0, 1)])
    length = np.linalg.norm(nodes[springs[:, 1]] - nodes[springs[:, 0]], axis=1)
    net = Chains(springs, ratio * length, np.full(len(springs), 10.0), np.full(len(springs), two_way))
    fixed = np.repeat(edge[:, None], 3, axis=1)
    return Structure(nodes, fixed, (net,))
