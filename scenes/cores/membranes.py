"""The membranes of a scene in its structural core: pressures that follow them, and what they show of a solved shape."""

from functools import partial

import numpy as np

from interface import Variable
from interface.mirror import canonical_faces, mirror_rows
from structural import FaceLoad, Faces
from structural.elements.membrane_results import Seams, enclosed_volume, reactions
from structural.materials.membranes import SLACK, WRINKLED

from .heading import outward

# Out-of-balance force over the external forces that counts as equilibrium, where the tolerance of the solver allows for
# more: membranes are soft across their plane, where a force that is small for their stiffness moves them far.
RELATIVE = 1e-9
PRESSURE = "pressure "  # what names of load groups begin with, so that none is that of the interface

tunable = partial(Variable, causality="parameter", variability="tunable")
output = partial(Variable, causality="output")


class MembraneModel:
    """What a `MembraneMesh` on `nodes` (n,3) m adds to a structural model; it has no state."""

    def __init__(self, mesh, nodes):
        self.mesh, self._nodes = mesh, nodes
        ends = [np.zeros((0, 2), dtype=int), *mesh.seams.values()]
        self._seams = Seams.of(mesh.group, np.concatenate(ends))

    @property
    def groups(self):
        """The groups of elements: one."""
        return (self.mesh.group,)

    @property
    def load_groups(self):
        """Name -> faces of each pressure."""
        return {PRESSURE + p.name: Faces(p.faces) for p in self.mesh.pressures}

    def loads(self, values):
        """Name -> load of each pressure that is not zero."""
        found = {p.name: (float(values[p.name]), len(p.faces)) for p in self.mesh.pressures}
        return {PRESSURE + name: FaceLoad(np.full(count, p)) for name, (p, count) in found.items() if p != 0.0}

    def mirrored(self, mirror):
        """Whether every face under pressure has a mirror image, `mirror` (n,) being that of the nodes."""
        return all(np.all(mirror_rows(p.faces, mirror, canonical_faces) >= 0) for p in self.mesh.pressures)

    def variables(self):
        """Parameters: the pressures."""
        for p in self.mesh.pressures:
            text = "pressure on membranes along their normals, which it follows"
            yield tunable(p.name, unit="Pa", start=p.start, minimum=-1e7, maximum=1e7, description=text)

    def outputs(self):
        """Outputs, as `shown` and `reactions` fill them."""
        names, mesh = self.mesh.group.names, self.mesh
        of_element = partial(output, labels=names, counts="membrane element")
        e, of_pair = len(names), ("larger", "smaller")
        pair = partial(output, shape=(e,), labels=names, counts="membrane element", unit="N/m")
        for k, which in enumerate(of_pair):
            text = f"{which} principal stress (2nd Piola-Kirchhoff) in force per length of the pattern"
            yield pair(STRESS[k], description=text)
        for k, which in enumerate(of_pair):
            yield pair(CAUCHY[k], description=f"{which} principal Cauchy stress in force per present length")
        yield of_element("wrinkle_state", (e,), kind="integer", description="0: slack, 1: wrinkled, 2: taut")
        text = "unit vector along the larger principal stress, which wrinkles follow"
        yield of_element("wrinkle_direction", (e, 3), description=text)
        yield of_element("membrane_strain", (e,), description="larger principal Green-Lagrange strain")
        yield output("slack_area_share", description="share of the area of the membranes that is slack")
        yield output("wrinkled_area_share", description="share of the area of the membranes that is wrinkled")
        for p in mesh.pressures:
            if p.encloses:
                text = f"volume within the membranes under {p.name}, up to planes of symmetry"
                yield output(f"{p.name}_volume", unit="m3", description=text)
        if mesh.supports:
            labels = tuple(f"support {support.name}" for support in mesh.supports)
            text = "force of the structure on its supports"
            yield output(
                "support_group_force", (len(labels), 3), unit="N", description=text, labels=labels, counts="support"
            )
        if self._seams.count:
            labels = tuple(f"side {k + 1} of {name}" for name, sides in mesh.seams.items() for k in range(len(sides)))
            text = "force per length of the pattern with which the membranes beside it pull at the seam"
            shape = len(labels), 3
            yield output("seam_force", shape, unit="N/m", description=text, labels=labels, counts="side of a seam")

    def shown(self, measured, x, axes):
        """Outputs that follow from a shape: positions x (n,3) m and what the elements `measured` there."""
        area, state = measured["area"], measured["state"]
        out = dict(zip(STRESS, measured["stress"].T, strict=True)) | dict(
            zip(CAUCHY, measured["cauchy"].T, strict=True)
        )
        out |= {
            "wrinkle_state": state,
            "wrinkle_direction": outward(measured["direction"], axes),
            "membrane_strain": measured["strain"][:, 0],
            "slack_area_share": float(area[state == SLACK].sum() / area.sum()),
            "wrinkled_area_share": float(area[state == WRINKLED].sum() / area.sum()),
        }
        for p in self.mesh.pressures:
            if p.encloses:
                out[f"{p.name}_volume"] = enclosed_volume(x, p.faces)
        if self._seams.count:
            out["seam_force"] = outward(self._seams.forces(x), axes)
        return out

    def reactions(self, structure, x, loads, rotations, axes):
        """The output of forces on groups of supports of a `structure` in equilibrium at x (n,3) m."""
        if not self.mesh.supports:
            return {}
        on_nodes = -reactions(structure, x, loads, rotations)
        sums = [np.where(s.held, on_nodes[s.nodes].sum(axis=0), 0.0) for s in self.mesh.supports]
        return {"support_group_force": outward(np.array(sums), axes)}


STRESS = "membrane_stress_1", "membrane_stress_2"
CAUCHY = "membrane_cauchy_stress_1", "membrane_cauchy_stress_2"
