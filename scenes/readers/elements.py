"""Elements of a scene's tables: springs, canopy quads and lines, and the masses that they and single nodes bring."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from structural import quad_rows, triple_bending

from ..schema import SceneError
from .tables import Table, name, names, non_negative, positive, read_table


@dataclass(frozen=True)
class Element:
    name: str
    nodes: tuple[int, ...]
    l0: float
    k: float
    area: float
    two_way: bool
    mass: float
    fabric: bool = False


def _resolve(table: Table, row: int, index: dict[str, int], least: int, most: int) -> tuple[int, ...]:
    chain = table["nodes"][row]
    if not least <= len(chain) <= most:
        wanted = str(least) if least == most else f"at least {least}"
        raise SceneError(
            f"{table.at(row)}: 'nodes' lists {len(chain)} nodes where {wanted} are needed; correct the cell."
        )
    for label in chain:
        if label not in index:
            raise SceneError(f"{table.at(row)}: node '{label}' is not in the node table; add it or correct the name.")
    if any(a == b for a, b in pairwise(chain)):
        raise SceneError(f"{table.at(row)}: '{table['name'][row]}' starts and ends a leg at one node; correct 'nodes'.")
    return tuple(index[label] for label in chain)


def springs(path, index, nodes, structure):
    columns = {
        "name": name, "nodes": names, "rest_length_m": non_negative, "stiffness_N_per_m": positive,
        "mass_kg": non_negative,
    }  # fmt: skip
    t = read_table(path, columns)
    for row in range(len(t)):
        ends = _resolve(t, row, index, 2, 2)
        element = Element(
            t["name"][row], ends, t["rest_length_m"][row], t["stiffness_N_per_m"][row], 0.0, True, t["mass_kg"][row]
        )
        yield element, t.at(row)


def canopy_quads(path, index, nodes, structure):
    """Six-spring quads: four edges and two diagonals at their reference lengths.

    An edge of two quads is one spring, with the stiffness of the first and the mass of both.
    """
    columns = {"name": name, "nodes": names, "stiffness_N_per_m": positive, "mass_kg": non_negative}
    t = read_table(path, columns)
    edges: dict[tuple[int, int], list[Any]] = {}
    for row in range(len(t)):
        a, b, c, d = _resolve(t, row, index, 4, 4)
        if len({a, b, c, d}) < 4:
            raise SceneError(f"{t.at(row)}: quad '{t['name'][row]}' uses a node twice; name four different nodes.")
        pairs = {"ab": (a, b), "bc": (b, c), "cd": (c, d), "da": (d, a), "ac": (a, c), "bd": (b, d)}
        for side, (i, j) in pairs.items():
            mass = t["mass_kg"][row] / 6.0
            if (min(i, j), max(i, j)) in edges:
                edges[min(i, j), max(i, j)][-1] += mass
                continue
            length = float(np.linalg.norm(nodes[i] - nodes[j]))
            k = t["stiffness_N_per_m"][row]
            edges[min(i, j), max(i, j)] = [t.at(row), f"{t['name'][row]}_{side}", (i, j), length, k, mass]
    for where, label, ends, length, k, mass in edges.values():
        yield Element(label, ends, length, k, 0.0, True, mass), where


def canopy_bending(path, index, nodes, stiffness):
    """Bending springs of the rows of nodes that run on over the common edges of canopy quads, at rest as drawn.

    `stiffness` N m is that of the fabric per width; a row has half of the quads on either side of it for its width.
    """
    t = read_table(path, {"name": name, "nodes": names, "stiffness_N_per_m": positive, "mass_kg": non_negative})
    quads = np.array([_resolve(t, row, index, 4, 4) for row in range(len(t))])
    triples = quad_rows(quads)
    if not len(triples):
        return ()
    p = nodes[quads]
    area = 0.5 * np.linalg.norm(np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]), axis=1)
    beside: dict[tuple[int, int], float] = {}
    for quad, a in zip(quads.tolist(), area, strict=True):
        for i in range(4):
            edge = min(quad[i], quad[i - 1]), max(quad[i], quad[i - 1])
            beside[edge] = beside.get(edge, 0.0) + 0.5 * a
    sides = [[(min(i, j), max(i, j)) for i, j in pairwise(row)] for row in triples.tolist()]
    length = np.linalg.norm(np.diff(nodes[triples], axis=1), axis=2).sum(axis=1)
    width = np.array([sum(beside[edge] for edge in pair) for pair in sides]) / length
    return (triple_bending(triples, nodes, stiffness * width),)


def lines(path, index, nodes, structure):
    t = read_table(path, {"name": name, "nodes": names, "rest_length_m": positive, "diameter_m": positive})
    modulus, density = structure.line_modulus, structure.line_density
    if modulus is None:
        raise SceneError(f"{path.parent.name}/scene.toml: [structure] lacks 'line_modulus', which lines need; add it.")
    for row in range(len(t)):
        chain = _resolve(t, row, index, 2, 1000)
        l0 = t["rest_length_m"][row]
        area = 0.25 * np.pi * t["diameter_m"][row] ** 2
        yield Element(t["name"][row], chain, l0, modulus * area / l0, area, False, density * area * l0), t.at(row)


def mass_shares(points):
    """Shares (m,) of an element's mass at its nodes: each leg by its length, half to each of its ends."""
    leg = np.linalg.norm(np.diff(points, axis=0), axis=1)
    leg = leg / leg.sum() if leg.sum() > 0.0 else np.full(len(leg), 1.0 / len(leg))
    shares = np.zeros(len(points))
    shares[:-1] += 0.5 * leg
    shares[1:] += 0.5 * leg
    return shares


def point_masses(path, index, mass):
    t = read_table(path, {"node": name, "mass_kg": non_negative})
    for row, label in enumerate(t["node"]):
        if label not in index:
            raise SceneError(f"{t.at(row)}: node '{label}' is not in the node table; add it or correct the name.")
        mass[index[label]] += t["mass_kg"][row]
