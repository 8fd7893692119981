"""Which degrees of freedom are solved for: supports, mirror symmetry, rigid links, and the order of elimination.

Rigid links eliminate dependent nodes from residual and tangent (master-slave elimination), exact for any rotation. A
dependent node stands at x = x_c + rho, rho = R rho_0 with its reference node c and the rotation R of that, so that
dx = dx_c + w x rho for a spin w. Its forces f go to c, with the moment rho x f; its stiffness goes with them, and f on
the turning arm adds the second derivative sym(rho f^T) - (rho.f) I along rotations about fixed axes.
"""

from dataclasses import dataclass

import numpy as np

from interface.mirror import MIRROR
from interface.vectors import cross, spin


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Positions x = base + sign * q[index] where index >= 0, so that x.flat = expand(q); then the spins (rotation
    increments) of the nodal rotations.

    Without symmetry `index` counts the free dofs. With it only the half y >= 0 is unknown: the other half follows with
    the sign of y turned (of x and z for spins), and y = 0 in the plane itself is a consequence, not a support.
    """

    index: np.ndarray  # (3n + 3r,) int, -1 for known dofs
    sign: np.ndarray  # (3n + 3r,) +-1
    base: np.ndarray  # (3n,) m, known positions
    first: np.ndarray  # (q,) the dof that stands for each unknown
    shares: np.ndarray  # (q,) how many dofs each unknown stands for: 2 with a mirror image, else 1

    @property
    def count(self):
        """Number of unknowns."""
        return len(self.first)

    @property
    def rotational(self):
        """Which unknowns are rotational dofs (spins), (q,) bool."""
        return self.first >= len(self.base)

    def expand(self, q):
        """Node positions (n,3) from the unknowns (q,)."""
        return self.base.reshape(-1, 3) + self.displacements(q)

    def displacements(self, step):
        """Displacements (n,3) m of the nodes in a `step` (q,) of the unknowns."""
        index = self.index[: len(self.base)]
        free = index >= 0
        dx = np.zeros(len(index))
        dx[free] = self.sign[: len(index)][free] * step[index[free]]
        return dx.reshape(-1, 3)

    def spins(self, step):
        """Spins (r,3) rad of the nodal rotations in a `step` (q,) of the unknowns."""
        n = len(self.base)
        index = self.index[n:]
        return np.where(index >= 0, self.sign[n:] * step[index], 0.0).reshape(-1, 3)

    def restrict(self, x):
        """Unknowns (q,) of node positions (n,3); zero for spins, which start from the present
        rotations."""
        rotational = self.rotational
        return np.where(rotational, 0.0, x.reshape(-1)[np.where(rotational, 0, self.first)])

    def norm(self, r):
        """Euclidean norm over the free dofs of the whole structure of forces N and moments N m, from the generalised
        values r (q,).

        A dof and its mirror image share r equally, so that the pair adds r^2 / 2.
        """
        return float(np.sqrt(np.sum(r * r / self.shares)))

    def gather(self, f):
        """Generalised forces (q,) of nodal forces (n,3), and of nodal moments where they follow, (n + r, 3)."""
        f = f.reshape(-1)
        index = self.index[: len(f)]
        free = index >= 0
        return np.bincount(index[free], (self.sign[: len(f)] * f)[free], minlength=self.count)


def unknowns(structure, mirror=None, order=None, with_dependents=False):
    """Unknowns of a structure, with its `mirror` permutation of nodes if any; those of one node stand together, nodes
    of lower `order` (n,) first.

    Dependent nodes have none of their own, or, `with_dependents`, stand behind all others as if they were free.
    """
    nodes, rotation_nodes = structure.nodes, structure.rotation_nodes
    n, r = len(nodes), len(rotation_nodes)
    of_node = np.concatenate([np.arange(n), rotation_nodes])
    dof = np.arange(3 * (n + r)).reshape(-1, 3)
    sign = np.ones((n + r, 3))
    master = dof.copy()
    known = np.concatenate([structure.fixed, structure.fixed_rotations])
    dependent = np.zeros(n + r, dtype=bool)
    dependent[structure.dependent_nodes] = True
    known[dependent] = not with_dependents
    if mirror is not None:
        image = np.concatenate([mirror, n + rotation_images(rotation_nodes, mirror)])
        y = nodes[of_node, 1]
        other = (y < 0.0) | ((y == 0.0) & (image < np.arange(n + r)))
        in_plane = mirror[of_node] == of_node
        flip = np.concatenate([np.tile(MIRROR, (n, 1)), np.tile(-MIRROR, (r, 1))])
        master[other] = dof[image[other]]
        sign[other] = flip[other]
        known |= known[image]
        known |= in_plane[:, None] & (flip < 0.0)
    own = (~known) & (master == dof)
    first = dof[own]
    place = np.zeros(n) if order is None else order
    key = np.where(dependent[first // 3], np.inf, place[of_node[first // 3]])
    if order is not None or with_dependents:
        first = first[np.argsort(key, kind="stable")]
    number = np.full(3 * (n + r), -1)
    number[first] = np.arange(len(first))
    index = np.where(known, -1, number[master])
    base = np.where(known[:n], nodes, 0.0)
    shares = np.bincount(index[index >= 0].reshape(-1), minlength=len(first))
    return Unknowns(index.reshape(-1), sign.reshape(-1), base.reshape(-1), first, shares)


def rotation_images(rotation_nodes, mirror):
    """Nodal rotation (r,) at the mirror image of the node of each; several at one node pair in the order of their rows.

    `rotation_nodes` (r,) as in `Structure`, `mirror` (n,) the images of the nodes.
    """
    places: dict[int, list[int]] = {}
    for row, node in enumerate(rotation_nodes.tolist()):
        places.setdefault(node, []).append(row)
    nth = {row: k for rows in places.values() for k, row in enumerate(rows)}
    try:
        return np.array([places[mirror[node]][nth[row]] for row, node in enumerate(rotation_nodes.tolist())], dtype=int)
    except (KeyError, IndexError):
        raise ValueError("a nodal rotation has no mirror image although the structure is to be halved") from None


class RigidLinks:
    """Reduction of a structure's unknowns with free dependent nodes, (w,) on a pattern, to its unknowns (q,), built
    once.
    """

    def __init__(self, structure, unreduced, unknowns):
        self._arms, self._rotations = structure.arms, structure.link_rotations
        self._dependent, self._reference = structure.dependent_nodes, structure.reference_nodes
        self._count = unknowns.count
        n = len(structure.nodes)
        link_of = np.full(n, -1)
        link_of[self._dependent] = np.arange(len(self._dependent))
        dofs = unreduced.first[unknowns.count :]  # of the dependent nodes that are solved for
        row, axis = link_of[dofs // 3], dofs % 3
        spins = 3 * (n + self._rotations[row])[:, None] + np.arange(3)
        targets = np.column_stack([3 * self._reference[row] + axis, spins])  # (dependent dofs, 4)
        index, sign = unknowns.index[targets], unknowns.sign[targets]
        value = np.column_stack([np.full(len(row), -1), 9 * row[:, None] + 3 * axis[:, None] + np.arange(3)])
        keep = (index >= 0) & (value % 9 % 4 != 0) | (index >= 0) & (value < 0)  # a spin's diagonal is zero
        self._from = np.repeat(np.arange(len(row)), keep.sum(axis=1))
        self._to, self._sign, self._value = index[keep], sign[keep], value[keep]
        self._own = row, axis
        self._block_index = np.broadcast_arrays(unknowns.index[spins][:, :, None], unknowns.index[spins][:, None, :])
        signs = unknowns.sign[spins]
        self._block_sign = signs[:, :, None] * signs[:, None, :]

    def factors(self, rotations):
        """Entries of the derivative of the dependent nodes by the unknowns, and the arms rho (k,3) m."""
        rho = np.einsum("kij,kj->ki", rotations[self._rotations], self._arms)
        moving = -spin(rho).reshape(-1)
        return self._sign * np.where(self._value < 0, 1.0, moving[self._value]), rho

    def place(self, x, rotations):
        """Put the dependent nodes of the positions x (n,3) m where they belong."""
        x[self._dependent] = x[self._reference] + np.einsum("kij,kj->ki", rotations[self._rotations], self._arms)

    def displace(self, dx, spins, rotations):
        """Give the dependent nodes their displacements among dx (n,3) m: those of their reference nodes, and what
        `spins` (r,3) rad add.
        """
        rho = np.einsum("kij,kj->ki", rotations[self._rotations], self._arms)
        dx[self._dependent] = dx[self._reference] + cross(spins[self._rotations], rho)

    def forces(self, unreduced, factors):
        """Generalised forces (q,) of those (w,) with free dependent nodes."""
        transferred = np.bincount(self._to, factors * unreduced[self._count :][self._from], minlength=self._count)
        return unreduced[: self._count] + transferred

    def pattern(self, rows, columns):
        """Rows and columns of the reduced tangent, from those of the unreduced one; kept for `stiffness`."""
        entries = np.arange(len(rows))
        begin = np.searchsorted(self._from, np.arange(self._from[-1] + 2 if len(self._from) else 1))

        def spread(entry, at, factor, other, other_factor):
            """Replace unreduced indices `at` by those of the unknowns they depend on."""
            dependent = at >= self._count
            j = np.where(dependent, at - self._count, 0)
            start = np.where(dependent, begin[j], 0)
            number = np.where(dependent, begin[np.minimum(j + 1, len(begin) - 1)] - start, 1)
            take = np.repeat(np.arange(len(at)), number)
            nth = np.arange(len(take)) - np.repeat(np.cumsum(number) - number, number)
            source = start[take] + nth
            new = np.where(dependent[take], self._to[np.where(dependent[take], source, 0)], at[take])
            new_factor = np.where(dependent[take], 1 + source, factor[take])
            return entry[take], new, new_factor, other[take], other_factor[take]

        none = np.zeros(len(rows), dtype=int)
        entry, row, by_row, column, by_column = spread(entries, rows, none, columns, none)
        entry, column, by_column, row, by_row = spread(entry, column, by_column, row, by_row)
        self._source, self._by_row, self._by_column = entry, by_row, by_column
        r, c = self._block_index
        keep = (r >= 0) & (c >= 0)
        self._block_keep = keep
        return np.concatenate([row, r[keep]]), np.concatenate([column, c[keep]])

    def stiffness(self, target, nnz, data, residual, factors, rho):
        """Data (nnz,) of the reduced tangent from those of the unreduced one and its `residual` (w,); `target` is where
        the entries of `pattern` go.
        """
        f = np.concatenate([[1.0], factors])
        row, axis = self._own
        force = residual[self._count :]
        arm = rho[row]
        unit = np.eye(3)[axis]
        second = 0.5 * (arm[:, :, None] * unit[:, None, :] + unit[:, :, None] * arm[:, None, :])
        second -= arm[np.arange(len(row)), axis][:, None, None] * np.eye(3)
        second *= force[:, None, None] * self._block_sign
        values = np.concatenate([data[self._source] * f[self._by_row] * f[self._by_column], second[self._block_keep]])
        return np.bincount(target, values, minlength=nnz)
