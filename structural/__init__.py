"""Structural solver: springs, lines, ropes over pulleys, beams and tubes, follower loads, static equilibrium."""

from interface.mirror import mirror_permutation, mirror_rows
from interface.panels import area_vectors, corner_shares

from .assembly import Assembly
from .elements import Configuration, ElementGroup
from .elements.beams import Beams, natural_deformations, reference_axes, section_forces
from .elements.bending import BendingSprings, bending_energy, quad_rows, row_bending, triple_bending
from .elements.chains import Chains, damping_forces, tensions
from .loads import FaceLoad, Faces, Legs, LineLoad, Lines, LoadGroup, Wind
from .loads.faces import surface_forces, surface_forces_and_tangents
from .loads.legs import drag_forces, line_load_forces, line_load_forces_and_tangents
from .materials.sections import LinearSection
from .materials.tubes import breukels_tube, collapse_deflection, inflatable_tube, tip_load, torque
from .model import Loads, Structure, interface_groups, interface_loads
from .solve.statics import Equilibrium, LoadSensitivity, equilibrium

__all__ = [
    "Assembly",
    "Beams",
    "BendingSprings",
    "Chains",
    "Configuration",
    "ElementGroup",
    "Equilibrium",
    "FaceLoad",
    "Faces",
    "Legs",
    "LineLoad",
    "LinearSection",
    "Lines",
    "LoadGroup",
    "LoadSensitivity",
    "Loads",
    "Structure",
    "Wind",
    "area_vectors",
    "bending_energy",
    "breukels_tube",
    "collapse_deflection",
    "corner_shares",
    "damping_forces",
    "drag_forces",
    "equilibrium",
    "inflatable_tube",
    "interface_groups",
    "interface_loads",
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
