"""Structural solver: springs, lines, ropes over pulleys, beams and tubes, follower loads, static equilibrium."""

from .assembly import Assembly
from .beams import Beams, natural_deformations, reference_axes, section_forces
from .chains import Chains, tensions
from .sections import LinearSection
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
    "Beams",
    "Chains",
    "Equilibrium",
    "LinearSection",
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
    "natural_deformations",
    "reference_axes",
    "section_forces",
    "surface_forces",
    "surface_forces_and_tangents",
    "tensions",
]
