"""Frames of beams, tubes, springs and rigid links that the tests of beams share."""

import numpy as np
import scipy.sparse as sp

from structural import (
    Beams,
    LinearSection,
    Loads,
    Structure,
    breukels_tube,
    interface_groups,
    interface_loads,
    reference_axes,
)
from tests.structural.models import MIRROR, chains

# Nodes of the right half and of the plane, then the left half; G and H depend on others, P and Q are the ends of the
# bridle.
_RIGHT = {
    "B": (0.05, 1.0, 0.9),
    "C": (0.2, 1.8, 0.4),
    "D": (1.2, 1.0, 0.85),
    "E": (1.0, 1.8, 0.35),
    "G": (0.6, 1.1, 1.0),
}
_PLANE = {"A": (0.0, 0.0, 1.0), "F": (1.3, 0.0, 0.95), "H": (0.5, 0.0, 1.2), "P": (0.3, 0.0, -3.0)}
NAMES = [*_RIGHT, *_PLANE, *(f"-{name}" for name in _RIGHT)]


def _at(*names):
    return np.array([NAMES.index(name) for name in names])


def _pairs(*pairs):
    """Rows of nodes, and their mirror images where these are others."""
    rows = [_at(*p) for p in pairs]
    image = mirror_of_frame()
    return np.array(rows + [image[r] for r in rows if not np.array_equal(np.sort(image[r]), np.sort(r))])


def mirror_of_frame():
    """Mirror image of every node."""
    image = {
        name: name if name in _PLANE else name.removeprefix("-") if name[0] == "-" else f"-{name}" for name in NAMES
    }
    return np.array([NAMES.index(image[name]) for name in NAMES])


def frame():
    """A wing frame: leading edge of tubes, struts of anisotropic beams and one across the plane of symmetry, rigid
    links on two of its nodes, a bridle of springs and a rope; panels and an exposed line between all kinds of nodes.

    Returns the structure and mirror-symmetric loads of all kinds, moments included.
    """
    right, plane = np.array(list(_RIGHT.values())), np.array(list(_PLANE.values()))
    nodes = np.concatenate([right, plane, right * MIRROR])
    n = len(nodes)
    rotation_nodes = _at("A", "B", "C", "D", "E", "F", "-B", "-C", "-D", "-E")
    of_node = np.full(n, -1)
    of_node[rotation_nodes] = np.arange(len(rotation_nodes))

    def beams(ends, section, across=None):
        l0 = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
        return Beams(ends, of_node[ends], reference_axes(nodes, ends, across), l0, section)

    edge = _pairs(("A", "B"), ("B", "C"))
    struts = _pairs(("B", "D"), ("C", "E"), ("A", "F"), ("-D", "D"))
    tubes = beams(edge, breukels_tube(0.3e5, np.full(len(edge), 0.09)))
    bars = beams(struts, LinearSection.of(len(struts), 3e4, 60.0, 40.0, kGA=5e3, EI_b=25.0), across=(0.0, 0.0, 1.0))
    springs = chains(_pairs(("P", "C"), ("P", "D"), ("P", "E"), ("P", "F")), 0.0, 30.0, True)
    springs.l0[:] = 0.98 * np.linalg.norm(np.diff(nodes[springs.nodes], axis=1)[:, 0], axis=1)
    ropes = chains(_pairs(("C", "P", "D")), 7.0, 40.0)
    dependent_nodes = _at("G", "H", "-G")
    link_rotations = of_node[_at("B", "A", "-B")]
    of_surface = _at("A", "B", "D", "F", "G", "H", "-B", "-D", "-G", "E", "-E")
    surface = sp.csr_array(np.eye(n)[of_surface])
    corner = {NAMES[k]: row for row, k in enumerate(of_surface)}
    panels = [("B", "A", "F", "D"), ("G", "H", "F", "D"), ("G", "D", "E", "E")]
    other = [[("-" + c) if "-" + c in corner else c for c in p] for p in panels]
    lines = np.array([[corner[c] for c in leg] for leg in (("G", "D"), ("-G", "-D"))])
    rows = [[corner[c] for c in p] for p in panels] + [[corner[c] for c in (p[0], p[3], p[2], p[1])] for p in other]
    fixed = np.zeros((n, 3), dtype=bool)
    fixed[_at("A", "P")] = True
    fixed_rotations = np.zeros((len(rotation_nodes), 3), dtype=bool)
    s = Structure(
        nodes, fixed, (springs, ropes, tubes, bars), interface_groups(surface, np.array(rows), lines),
        rotation_nodes, fixed_rotations, dependent_nodes, link_rotations,
    )  # fmt: skip
    image = mirror_of_frame()
    dead = np.zeros((n, 3))
    dead[_at("C", "E", "G", "H", "F")] = [
        (1.0, 2.0, 3.0),
        (0.5, -1.0, 2.0),
        (2.0, 1.0, 1.0),
        (1.0, 0, 2.0),
        (-1.0, 0, 3.0),
    ]
    dead = np.where(dead == 0.0, dead[image] * MIRROR, dead)
    moment = np.zeros((len(rotation_nodes), 3))
    moment[[1, 2, 4]] = [(1.0, -2.0, 0.5), (0.5, 1.0, -1.0), (1.0, 1.0, 0.5)]
    moment[[6, 7, 9]] = -moment[[1, 2, 4]] * MIRROR  # the image of an axial vector
    moment[0] = (0.0, 2.0, 0.0)
    pressure = np.array([3.0, -2.0, 4.0, 3.0, -2.0, 4.0])
    line_load = np.array([[1.0, 0.5, -2.0], [1.0, -0.5, -2.0]])
    return s, Loads(dead, interface_loads(pressure, None, line_load), moment=moment)
