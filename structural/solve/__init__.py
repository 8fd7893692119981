"""Solvers: sparse linear systems, Newton's method on any problem, static equilibrium and its derivative."""
