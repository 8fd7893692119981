"""What a membrane is asked for when it has been solved: pure functions of node positions."""

from dataclasses import dataclass

import numpy as np

from interface.vectors import cross
from structural.materials.membranes import SLACK, WRINKLED

from .membranes import MEMBRANE_STRAIN, Membranes

# Largest strain for which the linear law is meant.
LARGEST_STRAIN = MEMBRANE_STRAIN.limit


@dataclass(frozen=True, eq=False)
class MembraneState:
    """Stress and strain of elements (e,), those of T6 the means over their points by area.

    `stress` (e,2) N/m are the larger and the smaller principal 2nd Piola-Kirchhoff stress in force per length of the
    pattern, `cauchy` (e,2) those of the Cauchy stress in force per present length, `direction` (e,3) the unit vector in
    space along the larger, which wrinkles follow; `strain` (e,2) the larger and smaller principal Green-Lagrange
    strain; `state` (e,) SLACK, WRINKLED or TAUT, the lowest of the points; `area` (e,) m^2 of the pattern.
    """

    stress: np.ndarray
    cauchy: np.ndarray
    direction: np.ndarray
    strain: np.ndarray
    state: np.ndarray
    area: np.ndarray

    @property
    def slack_share(self):
        """Share of the area that is slack."""
        return float(self.area[self.state == SLACK].sum() / self.area.sum())

    @property
    def wrinkled_share(self):
        """Share of the area that is wrinkled."""
        return float(self.area[self.state == WRINKLED].sum() / self.area.sum())

    @property
    def largest_strain(self):
        """Largest principal strain; above LARGEST_STRAIN the linear law is outside its range."""
        return float(self.strain[:, 0].max(initial=-np.inf))


def membrane_state(group: Membranes, x) -> MembraneState:
    """Stress, strain and state of all elements at node positions x (n,3) m."""
    _, weights = group.geometry
    share = weights / weights.sum(axis=0)
    strain = group.strains(x)
    stress, _ = group.law.response(strain, tangents=False)
    state = group.law.state(strain).min(axis=0)
    f = np.sum(share * group.deformation_gradients(x).transpose(1, 2, 0, 3), axis=2)  # (2,3,e)
    s = np.sum(share * stress, axis=1)
    halved = np.sum(share * np.stack([strain[0], strain[1], 0.5 * strain[2]]), axis=1)
    first, second, angle = _principal(s)
    push = _pushed(f, s)
    direction = np.cos(angle) * f[0] + np.sin(angle) * f[1]
    size = np.sqrt(np.sum(direction**2, axis=0))
    unit = (direction / np.where(size > 0.0, size, 1.0)).T
    pairs = [np.stack(_principal(t)[:2], axis=1) for t in (push, halved)]
    return MembraneState(np.stack([first, second], axis=1), pairs[0], unit, pairs[1], state, weights.sum(axis=0))


def _principal(t):
    """Larger and smaller eigenvalue (e,) of symmetric (t11, t22, t12), and the angle of the larger's direction."""
    mean, half = 0.5 * (t[0] + t[1]), 0.5 * (t[0] - t[1])
    radius = np.hypot(half, t[2])
    return mean + radius, mean - radius, 0.5 * np.arctan2(t[2], half)


def _pushed(f, s):
    """F S F^T / J in orthonormal axes of the present plane (11, 22, 12), from F (2,3,e) and S (3,e)."""
    length = np.sqrt(np.sum(f[0] ** 2, axis=0))
    along = np.sum(f[0] * f[1], axis=0) / length
    across = np.sqrt(np.maximum(np.sum(f[1] ** 2, axis=0) - along**2, 0.0))
    j = length * across
    with np.errstate(divide="ignore", invalid="ignore"):  # an element that has lost its area has no Cauchy stress
        s11 = (length**2 * s[0] + 2.0 * length * along * s[2] + along**2 * s[1]) / j
        return np.stack([s11, across**2 * s[1] / j, (length * across * s[2] + along * across * s[1]) / j])


def enclosed_volume(x, faces):
    """Volume m^3 within closed faces (p,3) or (p,6) of nodes x (n,3), their normals outward; of open ones the volume of
    the cone to the origin.
    """
    if faces.shape[1] == 6:
        from structural.triangles import DEGREE_4, t6_functions, t6_slopes

        points, weights = DEGREE_4
        at = np.einsum("qi,pic->pqc", t6_functions(points), x[faces])
        g1, g2 = (np.einsum("qi,pic->pqc", t6_slopes(points)[:, :, a], x[faces]) for a in (0, 1))
        return float(np.einsum("q,pqc,pqc->", weights, at, cross(g1, g2)) / 3.0)
    a, b, c = (x[faces[:, k]] for k in range(3))
    return float(np.sum(a * cross(b, c)) / 6.0)


def nodal_forces(groups, at):
    """Internal forces (n,3) N of groups of elements on all nodes: on supported nodes, without other loads there, the
    reactions; of one group alone, what it passes on.
    """
    n = len(at.x)
    rotations = 0 if at.rotations is None else len(at.rotations)
    total = np.zeros(3 * (n + rotations))
    for group in groups:
        np.add.at(total, group.dofs(n).reshape(-1), group.forces(at).reshape(-1))
    return total.reshape(-1, 3)[:n]


def reactions(structure, x, loads, rotations=None):
    """Forces (n,3) N of the supports on the nodes, zero in free directions: internal forces minus loads.

    Sum them over the nodes of a group to have what it bears. Loads on a surface with weights are shared by these.
    """
    from .contract import Configuration

    at = Configuration(x, structure.initial_rotations if rotations is None else rotations)
    external = loads.dead.copy()
    for name, load in loads.on.items():
        group = structure.load_groups[name]
        surface = x if group.weights is None else group.weights @ x
        on_surface = np.zeros_like(surface)
        np.add.at(on_surface, group.nodes, group.forces(surface[group.nodes], load))
        external += on_surface if group.weights is None else group.weights.T @ on_surface
    return np.where(structure.fixed, nodal_forces(structure.groups, at) - external, 0.0)


def seam_forces(group: Membranes, x, seams):
    """Force per length N/m (k,3) of the pattern with which the elements beside each of the `seams` (k,2), sides
    between two nodes, pull at it: the mean of F S nu over both, nu the outward normal of the side of the first.
    ValueError for a side that no element has.
    """
    corners = np.array([[0, 1], [1, 2], [2, 0]])
    sides = np.sort(group.nodes[:, corners], axis=2)
    _, weights = group.geometry
    share = weights / weights.sum(axis=0)
    stress, _ = group.law.response(group.strains(x), tangents=False)
    s = np.sum(share * stress, axis=1)
    f = np.sum(share * group.deformation_gradients(x).transpose(1, 2, 0, 3), axis=2)
    out = np.zeros((len(seams), 3))
    for k, seam in enumerate(np.sort(seams, axis=1)):
        rows, places = np.nonzero(np.all(sides == seam, axis=2))
        if not len(rows):
            raise ValueError(f"no membrane element has a side between the nodes {seam[0]} and {seam[1]}.")
        pulls = [_traction(group, f, s, row, corners[place]) for row, place in zip(rows, places, strict=True)]
        out[k] = np.mean([p if i == 0 else -p for i, p in enumerate(pulls)], axis=0)
    return out


def _traction(group, f, s, row, ends):
    """F S nu (3,) N/m of one element on one of its sides."""
    start, end = group.fibre_pattern(row)[ends]
    side = end - start
    nu = np.array([side[1], -side[0]]) / np.linalg.norm(side)
    pull = np.array([s[0, row] * nu[0] + s[2, row] * nu[1], s[2, row] * nu[0] + s[1, row] * nu[1]])
    return pull[0] * f[0, :, row] + pull[1] * f[1, :, row]
