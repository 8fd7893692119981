"""Structural solver: springs, tension-only lines, ropes over pulleys, follower loads, static equilibrium."""

from .assembly import Assembly
from .chains import Chains, tensions
from .statics import Equilibrium, equilibrium
from .structure import Loads, Structure, canonical_chains, canonical_panels, mirror_permutation, mirror_rows
from .surface import (
    area_vectors,
    corner_shares,
    line_load_forces,
    line_load_forces_and_tangents,
    surface_forces,
    surface_forces_and_tangents,
)

__all__ = [
    "Assembly",
    "Chains",
    "Equilibrium",
    "Loads",
    "Structure",
    "area_vectors",
    "canonical_chains",
    "canonical_panels",
    "corner_shares",
    "equilibrium",
    "line_load_forces",
    "line_load_forces_and_tangents",
    "mirror_permutation",
    "mirror_rows",
    "surface_forces",
    "surface_forces_and_tangents",
    "tensions",
]
