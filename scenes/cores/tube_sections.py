"""Beams of a scene's tubes at a pressure, and what their forces say: strain of the fabric, moment over collapse."""

import numpy as np

from structural import Beams, breukels_tube, inflatable_tube, natural_deformations, reference_axes, section_forces


def tube_beams(members, structure, law, pressure):
    """The beams of all tubes (one group) at `pressure` Pa; ValueError in one sentence where the law has no answer."""
    tubes, nodes = members.wing.tubes, members.nodes
    l0 = np.linalg.norm(np.diff(nodes[tubes.ends], axis=1)[:, 0], axis=1)
    section = _section(tubes.radius, structure, law, pressure)
    return Beams(tubes.ends, tubes.rotations, reference_axes(nodes, tubes.ends), l0, section, tubes.names)


def _section(radius, structure, law, pressure):
    if law == "fabric":
        return inflatable_tube(pressure, radius, structure.tube_stiffness, structure.tube_shear_stiffness)
    tube = breukels_tube(pressure, radius)
    if law == "tip-deflection":
        from structural.materials.tip_deflection import tip_deflection_tube

        return tip_deflection_tube(tube)
    return tube


def tube_state(x, rotations, beams, radius):
    """Moment over collapse moment (e,), and strain of the fabric (e,) far from the axis: |N| / EA + kappa r.

    kappa is that of the larger end by the initial stiffness up to collapse, so a lower bound where the tube softens.
    """
    force = section_forces(x, rotations, beams)
    natural = natural_deformations(x, rotations, beams)
    full = beams.section.utilisation(force)
    bend = np.linalg.norm(natural[:, 3:5] - natural[:, 1:3], axis=1) / beams.l0
    return full, np.abs(force[:, 0]) / beams.section.EA + bend * radius
