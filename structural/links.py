"""Rigid links: nodes at a fixed place in a frame, eliminated from residual and tangent, exact for any rotation.

A rider stands at x = x_c + rho, rho = R rho_0 with its carrier's node c and rotation R, so that dx = dx_c + w x rho for
a spin w. Its forces f go to c, with the moment rho x f; its stiffness goes with them, and f on the turning arm adds the
second derivative sym(rho f^T) - (rho.f) I along rotations about fixed axes.
"""

import numpy as np

from .rotations import cross, spin


class RigidLinks:
    """Reduction of a structure's unknowns with free riders, (w,) on a pattern, to its unknowns (q,), built once."""

    def __init__(self, structure, wide, unknowns):
        self._arms, self._carriers, self._riders = structure.arms, structure.carriers, structure.riders
        self._count = unknowns.count
        n = len(structure.nodes)
        of_rider = np.full(n, -1)
        of_rider[structure.riders] = np.arange(len(structure.riders))
        dofs = wide.first[unknowns.count :]  # of the riders that are solved for
        row, axis = of_rider[dofs // 3], dofs % 3
        node, frame = structure.frames[structure.carriers[row]], structure.carriers[row]
        spins = 3 * (n + frame)[:, None] + np.arange(3)
        targets = np.column_stack([3 * node + axis, spins])  # (riders' dofs, 4)
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
        """Entries of the derivative of the riders with respect to the unknowns, and the arms rho (k,3) m."""
        rho = np.einsum("kij,kj->ki", rotations[self._carriers], self._arms)
        moving = -spin(rho).reshape(-1)
        return self._sign * np.where(self._value < 0, 1.0, moving[self._value]), rho

    def place(self, x, rotations, frames):
        """Put the riders of the positions x (n,3) m where they belong."""
        x[self._riders] = x[frames[self._carriers]] + np.einsum("kij,kj->ki", rotations[self._carriers], self._arms)

    def carry(self, dx, spins, rotations, frames):
        """Give the riders their displacements among dx (n,3) m, from those of their carriers and `spins` (r,3) rad."""
        rho = np.einsum("kij,kj->ki", rotations[self._carriers], self._arms)
        dx[self._riders] = dx[frames[self._carriers]] + cross(spins[self._carriers], rho)

    def forces(self, wide, factors):
        """Generalised forces (q,) of those (w,) with free riders."""
        carried = np.bincount(self._to, factors * wide[self._count :][self._from], minlength=self._count)
        return wide[: self._count] + carried

    def pattern(self, rows, columns):
        """Rows and columns of the reduced tangent, from those of the wide one; kept for `stiffness`."""
        entries = np.arange(len(rows))
        begin = np.searchsorted(self._from, np.arange(self._from[-1] + 2 if len(self._from) else 1))

        def spread(entry, at, factor, other, other_factor):
            """Replace wide indices `at` by those of the unknowns they depend on."""
            riding = at >= self._count
            j = np.where(riding, at - self._count, 0)
            start = np.where(riding, begin[j], 0)
            number = np.where(riding, begin[np.minimum(j + 1, len(begin) - 1)] - start, 1)
            take = np.repeat(np.arange(len(at)), number)
            nth = np.arange(len(take)) - np.repeat(np.cumsum(number) - number, number)
            source = start[take] + nth
            new = np.where(riding[take], self._to[np.where(riding[take], source, 0)], at[take])
            new_factor = np.where(riding[take], 1 + source, factor[take])
            return entry[take], new, new_factor, other[take], other_factor[take]

        none = np.zeros(len(rows), dtype=int)
        entry, row, by_row, column, by_column = spread(entries, rows, none, columns, none)
        entry, column, by_column, row, by_row = spread(entry, column, by_column, row, by_row)
        self._source, self._by_row, self._by_column = entry, by_row, by_column
        r, c = self._block_index
        keep = (r >= 0) & (c >= 0)
        self._block_keep = keep
        return np.concatenate([row, r[keep]]), np.concatenate([column, c[keep]])

    def stiffness(self, target, nnz, data, wide_residual, factors, rho):
        """Data (nnz,) of the reduced tangent from the wide one's; `target` is where the entries of `pattern` go."""
        f = np.concatenate([[1.0], factors])
        row, axis = self._own
        force = wide_residual[self._count :]
        arm = rho[row]
        unit = np.eye(3)[axis]
        second = 0.5 * (arm[:, :, None] * unit[:, None, :] + unit[:, :, None] * arm[:, None, :])
        second -= arm[np.arange(len(row)), axis][:, None, None] * np.eye(3)
        second *= force[:, None, None] * self._block_sign
        values = np.concatenate([data[self._source] * f[self._by_row] * f[self._by_column], second[self._block_keep]])
        return np.bincount(target, values, minlength=nnz)
