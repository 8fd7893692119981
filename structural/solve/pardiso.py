"""PARDISO of the Math Kernel Library, through pypardiso, for large tangents: it keeps what it found out of a pattern.

An extra (`pip install kitecosim[pardiso]`). Its factors serve where a direction is checked afterwards, as Newton steps
are: a pivot too small to divide by makes the matrix count as singular.
"""

import functools

import numpy as np

from . import Singular

STRUCTURALLY_SYMMETRIC = 1  # type of matrix: symmetric pattern, values that need not be
ANALYSE, FACTORISE, SOLVE = 11, 22, 33  # phases
# Given options; order of nested dissection; no refinement of solutions; pivots below 1e-13 of the matrix replaced; no
# scaling; no matching.
OPTIONS = {1: 1, 2: 2, 8: 0, 10: 13, 11: 0, 13: 0}
REPLACED_PIVOTS = 14


class PardisoFactors:
    """Factors of one matrix: `solve` right-hand sides with them. They are found anew where others took their place."""

    def __init__(self, matrix):
        self._library, self._matrix = library(), matrix
        self._library.factorise(matrix, self)

    def solve(self, b):
        """Solution x (q,) of A x = b."""
        if self._library.factors_of is not self:
            self._library.factorise(self._matrix, self)
        return self._library.call(SOLVE, self._matrix, np.ascontiguousarray(b, dtype=float))


class _Library:
    """The library with one pattern and one set of factors in it: a solve factorises one pattern again and again."""

    def __init__(self):
        from pypardiso import PyPardisoSolver
        from pypardiso.pardiso_wrapper import PyPardisoError

        self.factors_of = None
        self._pattern, self._error = None, PyPardisoError
        self._solver = PyPardisoSolver(mtype=STRUCTURALLY_SYMMETRIC)
        for place, value in OPTIONS.items():
            self._solver.set_iparm(place, value)

    def factorise(self, matrix, owner):
        """Factors of a matrix in place of those before; `Singular` if a pivot vanishes."""
        self.factors_of = None
        pattern = matrix.indptr, matrix.indices
        if self._pattern is None or not all(map(np.array_equal, pattern, self._pattern)):
            self._analyse(matrix)
        self.call(FACTORISE, matrix, np.zeros(matrix.shape[0]))
        if self._solver.get_iparm(REPLACED_PIVOTS):
            raise Singular("the matrix is singular.")
        self.factors_of = owner

    def call(self, phase, matrix, b):
        """What a phase of the library returns; `Singular` where it ends with an error."""
        self._solver.set_phase(phase)
        try:
            return self._solver._call_pardiso(matrix, b)
        except self._error as error:
            raise Singular(f"PARDISO found no factors: {error}") from None

    def _analyse(self, matrix):
        if self._pattern is not None:
            self._solver.free_memory(everything=True)
        self._pattern = None
        self._solver._check_A(matrix)
        self.call(ANALYSE, matrix, np.zeros(matrix.shape[0]))
        self._pattern = matrix.indptr, matrix.indices


@functools.cache
def library():
    """The library, loaded once; ImportError or OSError where it is not installed."""
    return _Library()
