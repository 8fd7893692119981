"""Structural solver: springs, lines, ropes over pulleys, beams and tubes, follower loads, static equilibrium."""

from .assembly import Assembly
from .beams import Beams, natural_deformations, reference_axes, section_forces
from .chains import Chains, tensions
from .sections import LinearSection
from .sensitivity import LoadSensitivity
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
from .tubes import breukels_tube, collapse_deflection, inflatable_tube, tip_load, torque

__all__ = [
    "Assembly",
    "Beams",
    "Chains",
    "Equilibrium",
    "LinearSection",
    "LoadSensitivity",
    "Loads",
    "Structure",
    "area_vectors",
    "breukels_tube",
    "canonical_chains",
    "canonical_panels",
    "collapse_deflection",
    "corner_shares",
    "equilibrium",
    "inflatable_tube",
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
    "tip_load",
    "torque",
]
