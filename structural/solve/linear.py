"""Sparse linear systems: the order of elimination, pivoting, and the direct solver, for every tangent of the project.

Tangents share one pattern for the life of an assembly, are nearly symmetric in values (follower loads are not) and
symmetric in pattern, and their unknowns are numbered in an order that fills in little. So a solver is asked for no
order of its own, and pivots stay on the diagonal unless they are tiny.
"""

import copy
import functools

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from . import Singular

# A pivot leaves the diagonal only where it is below this part of its column: elsewhere the fill stays that of the order
# in which the assembly numbers the unknowns. Steps are checked by their direction and residual, not by their digits.
# With a hundredth instead, a net of 20201 nodes with slack zones takes 2.6 times as long to factorise.
PIVOT = 1e-6
# More than a thousandth loses less than three digits: for factors that serve many right-hand sides without a check.
ACCURATE_PIVOT = 1e-3

# Unknowns from which Newton steps take PARDISO where it is installed: a solve then lasts long enough that the 0.3 s of
# loading it are little. Results differ from those of SuperLU by rounding, and from run to run with several threads.
LARGE = 15_000


class Factors:
    """Factors of one matrix: `solve` right-hand sides with them."""

    def __init__(self, matrix, pivot):
        try:
            self._factors = spla.splu(
                matrix, permc_spec="NATURAL", diag_pivot_thresh=pivot, options={"SymmetricMode": True}
            )
        except RuntimeError:  # "Factor is exactly singular"
            raise Singular("the matrix is exactly singular.") from None

    def solve(self, b):
        """Solution x (q,) of A x = b."""
        return self._factors.solve(b)

    @property
    def nnz(self):
        """Entries of the factors, fill and all."""
        return self._factors.nnz

    def negative_pivots(self):
        """How many pivots are below zero. Of a symmetric matrix whose pivots stayed on the diagonal that is how many
        eigenvalues are (Sylvester's law of inertia).
        """
        return int(np.count_nonzero(self._factors.U.diagonal() < 0.0))

    def negative_direction(self):
        """A direction v (q,) with v.A v < 0 of a symmetric matrix A = L D L^T: L^T v is the unit vector at the lowest
        pivot. None where no pivot is below zero, or some have left the diagonal.
        """
        upper, order = self._factors.U.tocsr(), self._factors.perm_c
        pivots = upper.diagonal()
        lowest = int(np.argmin(pivots))
        if pivots[lowest] >= 0.0 or not np.array_equal(order, self._factors.perm_r):
            return None
        right = np.zeros(len(pivots))
        right[lowest] = pivots[lowest]
        return spla.spsolve_triangular(upper, right, lower=False)[order]


def factorised(matrix, pivot=PIVOT):
    """Factors of a sparse (q,q) matrix whose unknowns are in an order of elimination; `Singular` if it is.

    By SuperLU; for Newton steps, whose `pivot` is PIVOT or less, of LARGE systems by PARDISO where it is installed.
    """
    if 0.0 < pivot <= PIVOT and matrix.shape[0] >= LARGE and has_pardiso():
        from . import pardiso

        return pardiso.PardisoFactors(matrix)
    return Factors(matrix, pivot)


@functools.cache
def has_pardiso():
    """Whether PARDISO is there: the extra `pardiso` is installed, and its libraries load."""
    try:
        from . import pardiso

        pardiso.library()
    except (ImportError, OSError):
        return False
    return True


def shifted(matrix, diagonal, shift):
    """The matrix with `shift`, one or (q,), added at the places `diagonal` of its data; it shares the pattern."""
    out = copy.copy(matrix)
    out.data = matrix.data.copy()
    out.data[diagonal] += shift
    return out


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
