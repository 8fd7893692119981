"""A structure: nodes, supports, elements, places where loads act and rigid links; and the loads on it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .elements import Configuration, ElementGroup
from .loads import FaceLoad, Faces, LineLoad, Lines, LoadGroup
from .loads.contract import Load

# What scenes and tests call the load groups of the surface between structure and flow.
PANELS, LINES = "panels", "lines"


def _none():
    return np.zeros(0, dtype=int)


@dataclass(frozen=True, eq=False)
class Structure:
    """Everything that does not change while loads and the values of elements do.

    `nodes` (n,3) reference positions m, `fixed` (n,3) bool supported directions, `groups` of elements, `load_groups`
    name -> where loads of that name act. `rotation_nodes` (r,) are the nodes of the nodal rotations (a node with
    rotational dofs has one, or one for each beam that is hinged to it), `fixed_rotations` (r,3) bool their supported
    directions, about fixed axes. Rigid links join the `dependent_nodes` (k,) to reference nodes, whose nodal rotations
    are `link_rotations` (k,).
    """

    nodes: np.ndarray
    fixed: np.ndarray
    groups: tuple[ElementGroup, ...] = ()
    load_groups: Mapping[str, LoadGroup] = field(default_factory=dict)
    rotation_nodes: np.ndarray = field(default_factory=_none)
    fixed_rotations: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), dtype=bool))
    dependent_nodes: np.ndarray = field(default_factory=_none)
    link_rotations: np.ndarray = field(default_factory=_none)

    @property
    def reference_nodes(self):
        """The reference node (k,) of each rigid link."""
        return self.rotation_nodes[self.link_rotations]

    @property
    def arms(self):
        """Rigid links (k,3) m from reference to dependent node in the reference configuration."""
        return self.nodes[self.dependent_nodes] - self.nodes[self.reference_nodes]

    @property
    def initial_rotations(self):
        """Nodal rotations (r,3,3) of the reference configuration, unit matrices; None without rotational dofs."""
        r = len(self.rotation_nodes)
        return np.broadcast_to(np.eye(3), (r, 3, 3)).copy() if r else None

    @property
    def reference(self):
        """The reference configuration, at rest."""
        return Configuration(self.nodes, self.initial_rotations)


@dataclass(frozen=True, eq=False)
class Loads:
    """External loads: `dead` (n,3) N on nodes, `on` name of a load group -> what acts there (none: nothing), `moment`
    (r,3) N m about fixed axes on the nodal rotations, None without.
    """

    dead: np.ndarray
    on: Mapping[str, Load] = field(default_factory=dict)
    moment: np.ndarray | None = None

    def between(self, other: "Loads", share: float) -> "Loads":
        """Linearly between these loads (share 0) and others (1); what only the others have acts as it is there."""
        on = {name: self.on[name].between(load, share) if name in self.on else load for name, load in other.on.items()}
        dead = other.dead if self.dead is other.dead else self.dead + share * (other.dead - self.dead)
        return replace(other, dead=dead, on=on)


def interface_groups(weights, panels, lines=None):
    """Load groups of a surface whose nodes are weights (s,n) @ structural nodes: `panels` (p,4) or (p,3), and `lines`
    (k,2) where it has some.
    """
    groups: dict[str, LoadGroup] = {}
    if len(panels):
        groups[PANELS] = Faces(panels, weights=weights)
    if lines is not None and len(lines):
        groups[LINES] = Lines(lines, weights=weights)
    return groups


def interface_loads(pressure=None, shear=None, line_load=None):
    """Loads on the groups of `interface_groups`: `pressure` (p,) Pa and `shear` (p,3) Pa on the panels,
    `line_load` (k,3) N/m on the lines; what is None is not there.
    """
    on: dict[str, Load] = {}
    if pressure is None and shear is not None:
        pressure = np.zeros(len(shear))
    if pressure is not None and len(pressure):
        on[PANELS] = FaceLoad(pressure, shear)
    if line_load is not None and len(line_load):
        on[LINES] = LineLoad(line_load)
    return on
