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


@dataclass(frozen=True, eq=False)
class Seams:
    """The sides of elements that pull at `count` seams, sides between two nodes: `group` the elements (p,) that have
    them, `seam` (p,) the seam, `normal` (2,p) the outward normal of the side in the axes of the fibres, and `share`
    (p,) what its pull counts.

    At a seam that joins sheets the first element pulls against all others, however many they are: in equilibrium each
    half of the sum, and of a seam on an open edge the whole, is the force that the seam passes on.
    """

    group: Membranes
    count: int
    seam: np.ndarray
    normal: np.ndarray
    share: np.ndarray

    @classmethod
    def of(cls, group: Membranes, seams):
        """Those of `seams` (k,2) nodes; ValueError for a side that no element has."""
        corners = np.array([[0, 1], [1, 2], [2, 0]])
        base = int(group.nodes.max(initial=0)) + 1

        def keys(sides):
            low, high = np.sort(sides, axis=-1).reshape(-1, 2).T
            return low * base + high

        wanted, sides = keys(np.asarray(seams)), keys(group.nodes[:, corners])
        order = np.argsort(sides, kind="stable")  # of a side, elements as they are numbered
        first = np.searchsorted(sides[order], wanted)
        many = np.searchsorted(sides[order], wanted, side="right") - first
        if len(missing := np.flatnonzero(many == 0)):
            low, high = np.sort(seams[missing[0]])
            raise ValueError(f"no membrane element has a side between the nodes {low} and {high}.")
        seam = np.repeat(np.arange(len(wanted)), many)
        rank = np.arange(len(seam)) - np.repeat(np.cumsum(many) - many, many)
        row, place = np.divmod(order[first[seam] + rank], 3)
        share = np.where(many[seam] == 1, 1.0, np.where(rank == 0, 0.5, -0.5))
        part = group.select(row)
        pattern = part.fibre_patterns()
        side = pattern[np.arange(len(row)), corners[place, 1]] - pattern[np.arange(len(row)), corners[place, 0]]
        normal = np.stack([side[:, 1], -side[:, 0]]) / np.linalg.norm(side, axis=1)
        return cls(part, len(wanted), seam, normal, share)

    def forces(self, x):
        """Force per length N/m (k,3) of the pattern with which the elements beside each seam pull at it at x (n,3) m:
        F S nu of the first, the mean with what the others hold against it.
        """
        group, nu = self.group, self.normal
        if not self.count:
            return np.zeros((0, 3))
        _, weights = group.geometry
        share = weights / weights.sum(axis=0)
        stress, _ = group.law.response(group.strains(x), tangents=False)
        s = np.sum(share * stress, axis=1)
        f = np.sum(share * group.deformation_gradients(x).transpose(1, 2, 0, 3), axis=2)
        pull = (s[0] * nu[0] + s[2] * nu[1]) * f[0] + (s[2] * nu[0] + s[1] * nu[1]) * f[1]
        return np.stack([np.bincount(self.seam, self.share * part, minlength=self.count) for part in pull], axis=1)
