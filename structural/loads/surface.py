"""Loaded elements of a surface, panels and exposed lines, seen from the unknowns of the structure."""

import numpy as np
import scipy.sparse as sp


class SurfaceElements:
    """Linear maps between the unknowns and e loaded elements with m corners each, built once.

    `corners` (e, m) are surface nodes, `weight` (e,) says how often each element counts (2 for one that stands for
    its mirror image too), `surface` (s, n) gives the surface nodes from the structural ones.
    """

    def __init__(self, corners, weight, surface, unknowns):
        self.count, m = corners.shape
        self._size, self._weight = 3 * m, weight
        of_nodes = sp.csr_array(surface)[corners.reshape(-1)]
        self._corner_map = of_nodes
        index, sign = (a[: len(unknowns.base)] for a in (unknowns.index, unknowns.sign))
        free = index >= 0
        shape = len(index), unknowns.count
        dofs = sp.csr_array((sign[free], (np.flatnonzero(free), index[free])), shape=shape)
        # constant derivative (3 m e, q) of the corner coordinates with respect to the unknowns
        self._slope = sp.csr_array(sp.kron(of_nodes, sp.identity(3), format="csr") @ dofs)
        self._gather = sp.csr_array(self._slope.multiply(np.repeat(weight, self._size)[:, None]).T)

    def corners(self, x):
        """Corner points (e, m, 3) m at node positions x (n,3)."""
        return (self._corner_map @ x).reshape(self.count, -1, 3)

    def generalised(self, forces):
        """Generalised forces (w,) N of forces (e, m, 3) N on the corners."""
        return self._gather @ forces.reshape(-1)

    def stiffness_entries(self):
        """Where the elements' tangents (e, 3m, 3m) go: row and column unknown, position in the tangents, factor."""
        entries = sp.coo_array(self._slope)
        row, column, value = entries.row, entries.col, entries.data
        size = self._size
        element = row // size
        counts = np.bincount(element, minlength=self.count)
        begin = np.cumsum(counts) - counts
        partners = counts[element]  # every entry meets all entries of its element
        left = np.repeat(np.arange(len(row)), partners)
        right = begin[element[left]] + np.arange(len(left)) - np.repeat(np.cumsum(partners) - partners, partners)
        position = size * size * element[left] + size * (row[left] % size) + row[right] % size
        return column[left], column[right], position, value[left] * value[right] * self._weight[element[left]]

    def stiffness_map(self, target, position, factor, nnz):
        """Sparse map from the elements' tangents, flattened, to the entries (nnz,) of the structure's tangent."""
        keep = target < nnz
        shape = nnz, self._size * self._size * self.count
        return sp.csr_array((factor[keep], (target[keep], position[keep])), shape=shape)
