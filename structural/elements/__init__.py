"""Families of elements, one a file, behind one contract: all that assembly and solvers ever ask of them."""

from .contract import Configuration, ElementGroup, translations

__all__ = ["Configuration", "ElementGroup", "translations"]
