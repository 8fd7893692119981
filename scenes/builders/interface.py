"""Interface meshes on struts, canopies and lines, and the linear maps that hang them on the structural nodes."""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from interface.mesh import station_panels

from ..interface import Interface

CHORD_FRACTIONS = np.array([0.0, 0.5, 1.0])
ROUNDING = 1e-12  # of weights of order one
QUARTERS = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))  # of a triangle of six nodes


def arc_length(points):
    """Length along the polyline of points (n,3) m from its first one, (n,) m."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def nearest_stations(points, line):
    """Stations (p,) of the polyline `line` (n,3) m nearest to the points (p,3): 2.25 is a quarter of the way from its
    third point to the fourth one.
    """
    along = np.diff(line, axis=0)
    gap = points[:, None] - line[:-1]
    at = np.clip(np.einsum("pik,ik->pi", gap, along) / np.einsum("ik,ik->i", along, along), 0.0, 1.0)
    distance = np.linalg.norm(gap - at[..., None] * along, axis=2)
    piece = distance.argmin(axis=1)
    return piece + at[np.arange(len(points)), piece]


def structural_interface(nodes, struts, per_bay):
    """Sections on the struts (b+1, 2: leading and trailing edge node) and `per_bay` strips between two of them."""
    bays = len(struts) - 1
    count = bays * per_bay
    station = np.arange(count + 1)
    bay = np.minimum(station // per_bay, bays - 1)
    eta = (station - bay * per_bay) / per_bay
    weights = _bilinear(len(nodes), struts, np.repeat(bay, 3), np.tile(CHORD_FRACTIONS, count + 1), np.repeat(eta, 3))
    return _interface(weights @ nodes, weights)


def design_interface(nodes, struts, leading_edge, trailing_edge, per_bay):
    """Sections (d,3) of the design wing, which follow the struts.

    Every interface node is an affine combination of the strut nodes around it: the bilinear weights of its projection
    on the bay, extended beyond the edges, plus the smallest change that hits the point exactly. Affine combinations
    turn with the structure, so rigid motion, force, moment and virtual work are kept exactly.
    """
    points = _stations(leading_edge, trailing_edge, (len(struts) - 1) * per_bay)
    bay, xi, eta = _project(points, nodes, struts)
    weights = _bilinear(len(nodes), struts, bay, xi, eta).tolil()
    bays = len(struts) - 1
    for i, (p, b) in enumerate(zip(points, bay, strict=True)):  # once, when the scene is built
        around = struts[max(b - 1, 0) : min(b + 2, bays) + 1].reshape(-1)
        a = np.vstack([nodes[around].T, np.ones(len(around))])
        w = weights[[i], around].toarray().ravel()
        weights[[i], around] = w + np.linalg.lstsq(a, np.append(p, 1.0) - a @ w, rcond=None)[0]
    weights = sp.csr_array(weights)
    weights.data[np.abs(weights.data) <= ROUNDING] = 0.0
    weights.eliminate_zeros()
    return _interface(points, weights)


def edges_interface(leading_edge, trailing_edge, per_gap):
    """Sections (d,3) of a rigid wing, with `per_gap` strips between two of them: its nodes are the interface nodes."""
    points = _stations(leading_edge, trailing_edge, (len(leading_edge) - 1) * per_gap)
    return _interface(points, sp.eye_array(len(points), format="csr"))


def _stations(leading_edge, trailing_edge, count):
    """Stations (3 (count + 1), 3) m of the sections of `count` strips along the rows (d,3) of the edges."""
    at = np.linspace(0.0, len(leading_edge) - 1.0, count + 1)
    k = np.minimum(at.astype(int), len(leading_edge) - 2)
    f = (at - k)[:, None]
    le = leading_edge[k] + f * (leading_edge[k + 1] - leading_edge[k])
    te = trailing_edge[k] + f * (trailing_edge[k + 1] - trailing_edge[k])
    return (le[:, None] + CHORD_FRACTIONS[:, None] * (te - le)[:, None]).reshape(-1, 3)


def grid_interface(nodes, grid):
    """The canopy grid (columns, stations) of structural nodes (n,3) itself: its nodes are the interface nodes."""
    flat = grid.reshape(-1)
    weights = sp.csr_array((np.ones(len(flat)), (np.arange(len(flat)), flat)), shape=(len(flat), len(nodes)))
    sections = np.arange(len(flat)).reshape(grid.shape)
    fractions = np.linspace(0.0, 1.0, grid.shape[1])
    panels = station_panels(sections)
    return Interface(nodes[flat], panels, weights, sections, fractions)


def face_interface(nodes, triangles):
    """The triangles (m,3) of structural nodes (n,3) themselves, or of each of second order (m,6) the four between its
    nodes: all of their nodes are interface nodes.
    """
    used = np.unique(triangles)
    place = np.zeros(len(nodes), dtype=int)
    place[used] = np.arange(len(used))
    corners = place[triangles if triangles.shape[1] == 3 else triangles[:, QUARTERS].reshape(-1, 3)]
    weights = sp.csr_array((np.ones(len(used)), (np.arange(len(used)), used)), shape=(len(used), len(nodes)))
    sections = np.zeros((0, 3), dtype=int)
    return Interface(nodes[used], corners[:, [0, 1, 2, 2]], weights, sections, CHORD_FRACTIONS)


def body_interface(surface, nodes, skin=None):
    """The interface of a `ClosedSurface`: its panels and trailing edges on structural nodes (n,3) m, its own in their
    order, or those `skin` (b,) that stand where its own do.
    """
    at = np.arange(len(nodes)) if skin is None else skin
    weights = sp.csr_array((np.ones(len(at)), (np.arange(len(at)), at)), shape=(len(at), len(nodes)))
    sections = np.zeros((0, 3), dtype=int)
    more = {"trailing_edges": surface.trailing_edges, "remarks": surface.remarks}
    return Interface(nodes[at], surface.panels, weights, sections, CHORD_FRACTIONS, **more)


def lines_interface(nodes):
    """The interface of a structure (n,3) m without a wing, to which `with_lines` adds all that it has."""
    none = np.zeros((0, 3))
    sections, panels = np.zeros((0, 3), dtype=int), np.zeros((0, 4), dtype=int)
    return Interface(none, panels, sp.csr_array((0, len(nodes))), sections, CHORD_FRACTIONS)


def with_lines(interface, nodes, legs, diameter):
    """The interface with the lines `legs` (k,2) of structural nodes (n,3) and their `diameter` (k,) m added.

    A line ends at the interface node that is its structural node already, where there is one, else at a new node.
    """
    weights = interface.weights
    single = np.flatnonzero(np.diff(weights.indptr) == 1)
    single = single[np.abs(weights.data[weights.indptr[single]] - 1.0) <= ROUNDING]
    place = np.full(len(nodes), -1)
    place[weights.indices[weights.indptr[single]]] = single
    new = np.setdiff1d(legs, np.flatnonzero(place >= 0))
    place[new] = len(interface.nodes) + np.arange(len(new))
    unit = sp.csr_array((np.ones(len(new)), (np.arange(len(new)), new)), shape=(len(new), len(nodes)))
    return replace(
        interface,
        nodes=np.concatenate([interface.nodes, nodes[new]]),
        weights=sp.csr_array(sp.vstack([weights, unit])),
        lines=place[legs],
        diameter=diameter,
    )


def _interface(nodes, weights):
    sections = np.arange(len(nodes)).reshape(-1, 3)
    panels = station_panels(sections)
    return Interface(nodes, panels, sp.csr_array(weights), sections, CHORD_FRACTIONS)


def _bilinear(node_count, struts, bay, xi, eta):
    """Weights (points, nodes) of points at chord fraction xi and span fraction eta of their bays."""
    rows = np.repeat(np.arange(len(bay)), 4)
    columns = np.stack([struts[bay, 0], struts[bay, 1], struts[bay + 1, 0], struts[bay + 1, 1]], axis=1)
    values = np.stack([(1 - xi) * (1 - eta), xi * (1 - eta), (1 - xi) * eta, xi * eta], axis=1)
    weights = sp.coo_array((values.ravel(), (rows, columns.ravel())), shape=(len(bay), node_count)).tocsr()
    weights.eliminate_zeros()
    return weights


def _project(points, nodes, struts):
    """Bay, xi and eta (p,) of the nearest point on the bilinear bays, extended beyond their chord and at the tips."""
    bays = len(struts) - 1
    le, te = nodes[struts[:, 0]], nodes[struts[:, 1]]
    best = np.full(len(points), np.inf)
    out = np.zeros(len(points), dtype=int), np.zeros(len(points)), np.zeros(len(points))
    for b in range(bays):
        xi, eta = np.full(len(points), 0.5), np.full(len(points), 0.5)
        for _ in range(30):  # Gauss-Newton
            a = le[b] + eta[:, None] * (le[b + 1] - le[b])
            c = te[b] + eta[:, None] * (te[b + 1] - te[b])
            d_xi = c - a
            d_eta = (1 - xi)[:, None] * (le[b + 1] - le[b]) + xi[:, None] * (te[b + 1] - te[b])
            j = np.stack([d_xi, d_eta], axis=2)
            gap = points - (a + xi[:, None] * d_xi)
            step = np.linalg.solve(np.einsum("pki,pkj->pij", j, j), np.einsum("pki,pk->pi", j, gap)[..., None])[..., 0]
            xi, eta = xi + step[:, 0], eta + step[:, 1]
        low = -np.inf if b == 0 else 0.0
        high = np.inf if b == bays - 1 else 1.0
        eta = np.clip(eta, low, high)
        on_bay = _bilinear(len(nodes), struts, np.full(len(points), b), xi, eta) @ nodes
        distance = np.linalg.norm(points - on_bay, axis=1)
        closer = distance < best - 1e-9
        best = np.where(closer, distance, best)
        for target, value in zip(out, (np.full(len(points), b), xi, eta), strict=True):
            target[closer] = value[closer]
    return out
