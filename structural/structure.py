"""A structure: nodes, supports, elements, rigid links, and the linear map from its nodes to the interface surface."""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.spatial import cKDTree

from .beams import Beams
from .bending import BendingSprings
from .chains import Chains
from .wind import Wind


@dataclass(frozen=True, eq=False)
class Structure:
    """Everything that does not change while loads and rest lengths do.

    `nodes` (n,3) reference positions m, `fixed` (n,3) bool supported directions, `chains` groups of
    elements with equally many nodes, `surface` (s, n) sparse weights with surface nodes = surface @ nodes, `panels`
    (p,4) surface node indices (a triangle repeats its last one), `lines` (k,2) surface nodes of the legs that carry
    line loads. `beams` are groups of beams; what turns with their nodes are the `frames` (r,), the node of each
    (a node has one, or one for each beam that is hinged to it), `clamped` (r,3) bool says about which fixed axes they
    cannot turn. `riders` (k,) are nodes at a fixed place in a frame: rigid links to the `carriers` (k,), frames.
    `bending` are groups of bending springs; `exposed` (k,2) nodes and their `diameter` (k,) m are the legs that stand
    in a wind that the loads name.
    """

    nodes: np.ndarray
    fixed: np.ndarray
    chains: tuple[Chains, ...]
    surface: sp.csr_array
    panels: np.ndarray
    lines: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=int))
    beams: tuple[Beams, ...] = ()
    frames: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    clamped: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), dtype=bool))
    riders: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    carriers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    bending: tuple[BendingSprings, ...] = ()
    exposed: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=int))
    diameter: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def arms(self):
        """Rigid links (k,3) m from the node of the carrier to the rider in the reference configuration."""
        return self.nodes[self.riders] - self.nodes[self.frames[self.carriers]]

    @property
    def unturned(self):
        """Rotation matrices (r,3,3) of the frames in the reference configuration."""
        return np.broadcast_to(np.eye(3), (len(self.frames), 3, 3)).copy()


@dataclass(frozen=True, eq=False)
class Loads:
    """External loads: `pressure` (p,) Pa and `shear` (p,3) Pa on the panels, `dead` (n,3) N on nodes, `line_load` (k,3)
    N/m on the lines, per current length, `moment` (r,3) N m about fixed axes on frames, `wind` on the exposed legs.
    None: not there.
    """

    pressure: np.ndarray
    shear: np.ndarray | None
    dead: np.ndarray
    line_load: np.ndarray | None = None
    moment: np.ndarray | None = None
    wind: Wind | None = None


def mirror_permutation(points, tolerance=1e-6):
    """Index of the mirror image in the plane y = 0 of every point (n,), or None if one has none within `tolerance` m.

    Points that coincide are paired with those at the image in the order of their indices.
    """
    tree = cKDTree(points)
    own = tree.query_ball_point(points, tolerance, return_sorted=True)
    there = tree.query_ball_point(points * np.array([1.0, -1.0, 1.0]), tolerance, return_sorted=True)
    if any(len(a) != len(b) for a, b in zip(own, there, strict=True)):
        return None
    return np.array([b[a.index(i)] for i, (a, b) in enumerate(zip(own, there, strict=True))], dtype=int)


def elimination_order(groups, free):
    """Place (n,) of every node in an order of elimination that fills in little: minimum degree on the graph of nodes.

    `groups` are sparse incidences (elements, n) of nodes that an element couples, `free` (n,) says which nodes are
    eliminated. Found once for a structure, it serves every factorisation.
    """
    n = len(free)
    incidence = sp.csr_array(sp.vstack([sp.csr_array((0, n)), *groups]))
    incidence.data[:] = 1.0
    incidence = incidence[:, free]
    graph = sp.csc_array(incidence.T @ incidence)
    order = np.full(n, n)
    if graph.shape[0]:
        # diagonally dominant, so that the pattern alone decides
        dominant = sp.csc_array(graph + sp.diags_array(graph.sum(axis=0) + 1.0))
        factors = spla.splu(
            dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        order[free] = factors.perm_c
    return order


def canonical_chains(nodes):
    """Chain nodes (e,m) read from the end with the smaller index, so that a rope and its reverse are one."""
    return np.where((nodes[:, :1] <= nodes[:, -1:]), nodes, nodes[:, ::-1])


def canonical_panels(nodes):
    """Panel nodes (p,4) in rising order, so that a panel may begin at any corner and run either way round."""
    return np.sort(nodes, axis=1)


def mirror_rows(nodes, mirror, canonical):
    """Row of the mirror image of each element (e,) with `nodes` (e,m), -1 where there is none; twins pair in order."""
    places: dict[tuple[int, ...], list[int]] = {}
    for row, key in enumerate(map(tuple, canonical(nodes).tolist())):
        places.setdefault(key, []).append(row)
    rows, taken = [], dict.fromkeys(places, 0)
    for key in map(tuple, canonical(mirror[nodes]).tolist()):
        nth = taken.get(key, 0)
        rows.append(places[key][nth] if nth < len(places.get(key, ())) else -1)
        taken[key] = nth + 1
    return np.array(rows, dtype=int)


def unique_half(images):
    """Rows of the elements that stay under mirror symmetry, and how often each counts (1 or 2), from `mirror_rows`."""
    if np.any(images < 0):
        raise ValueError("an element has no mirror image although the structure is to be halved")
    rows = np.flatnonzero(np.arange(len(images)) <= images)
    return rows, np.where(images[rows] == rows, 1.0, 2.0)
