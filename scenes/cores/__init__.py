"""Solver cores of scenes: a structural one, quasi-static or transient, an aerodynamic one, each behind named blocks."""

from .core import Core, CoreState, Result, Solver

__all__ = ["Core", "CoreState", "Result", "Solver"]
