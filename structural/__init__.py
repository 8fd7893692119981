"""Structural solver: springs, lines, ropes over pulleys, beams and tubes, follower loads, static equilibrium."""

from .assembly import Assembly
from .beams import Beams, natural_deformations, reference_axes, section_forces
from .bending import BendingSprings, bending_energy, quad_rows, row_bending, triple_bending
from .chains import Chains, tensions
from .damping import damping_forces
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
from .wind import Wind, drag_forces

__all__ = [
    "Assembly",
    "Beams",
    "BendingSprings",
    "Chains",
    "Equilibrium",
    "LinearSection",
    "LoadSensitivity",
    "Loads",
    "Structure",
    "Wind",
    "area_vectors",
    "bending_energy",
    "breukels_tube",
    "canonical_chains",
    "canonical_panels",
    "collapse_deflection",
    "corner_shares",
    "damping_forces",
    "drag_forces",
    "equilibrium",
    "inflatable_tube",
    "line_load_forces",
    "line_load_forces_and_tangents",
    "mirror_permutation",
    "mirror_rows",
    "natural_deformations",
    "quad_rows",
    "reference_axes",
    "row_bending",
    "section_forces",
    "surface_forces",
    "surface_forces_and_tangents",
    "tensions",
    "tip_load",
    "torque",
    "triple_bending",
]
