"""Structural solver: springs, tension-only lines, ropes over pulleys, follower loads, static equilibrium."""

from .assembly import Assembly
from .chains import Chains, tensions
from .statics import Equilibrium, equilibrium
from .structure import Loads, Structure, mirror_permutation
from .surface import area_vectors, corner_shares, surface_forces, surface_forces_and_tangents

__all__ = [
    "Assembly",
    "Chains",
    "Equilibrium",
    "Loads",
    "Structure",
    "area_vectors",
    "corner_shares",
    "equilibrium",
    "mirror_permutation",
    "surface_forces",
    "surface_forces_and_tangents",
    "tensions",
]
