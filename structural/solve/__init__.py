"""Solvers: sparse linear systems, Newton's method on any problem, static equilibrium and its derivative."""


class Singular(ArithmeticError):
    """A matrix has no inverse."""
