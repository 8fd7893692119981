"""The members of a scene: nodes, elements in groups and masses, at the scene's scale."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .schema import SceneError

if TYPE_CHECKING:
    from structural import BendingSprings, Chains
    from structural.elements.membranes import Membranes


_NO_LEGS, _NONE = np.zeros((0, 2), dtype=int), np.zeros(0)


@dataclass(frozen=True, eq=False)
class Tubes:
    """Beams of inflated tubes: `ends` (e,2) nodes and nodal `rotations` (e,2) of both ends, `radius` (e,) m at their
    middle, `names` (e,) and the `tube` (e,) that each is a part of.
    """

    ends: np.ndarray
    rotations: np.ndarray
    radius: np.ndarray
    names: tuple[str, ...]
    tube: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class WingMesh:
    """What the mesher adds to the nodes of the tables.

    `nodes` (n,3) m and `labels`, those of the tables first; `grid` (columns, stations) node indices of the canopy from
    the left tip to the right one and from leading to trailing edge; `tubes`; `rotation_nodes` (r,) the node of each
    nodal rotation; `dependent_nodes` (k,) on rigid links to the nodal rotations `link_rotations` (k,); `springs` the
    canopy as (name, ends, rest length m, stiffness N/m), tension only; `canopy_mass` (n,) kg and `tube_length` (n,) m,
    the share of each node.
    """

    nodes: np.ndarray
    labels: tuple[str, ...]
    grid: np.ndarray
    tubes: Tubes
    rotation_nodes: np.ndarray
    dependent_nodes: np.ndarray
    link_rotations: np.ndarray
    springs: list[tuple[str, tuple[int, int], float, float]]
    canopy_mass: np.ndarray
    tube_length: np.ndarray


@dataclass(frozen=True, eq=False)
class MembraneSupport:
    """A group of `nodes` (k,) of membranes that is held in the directions `held` (3,)."""

    name: str
    nodes: np.ndarray
    held: np.ndarray


@dataclass(frozen=True, eq=False)
class MembranePressure:
    """A follower pressure on `faces` (p,3|6) of nodes that a scene offers as parameter `name`, `start` Pa at first;
    `encloses` says that the faces close a volume, perhaps with planes of symmetry through the origin.
    """

    name: str
    start: float
    faces: np.ndarray
    encloses: bool


@dataclass(frozen=True, eq=False)
class MembraneMesh:
    """The membranes of a scene and what [membranes] says of them.

    `group` the elements, whose `fabric` (e,) is one of the `fabrics`; `supports`, `pressures`; `seams` name of a group
    of lines -> sides (k,2) of triangles; `cables` names of the chains along lines; `remarks` what was changed when the
    mesh was read. Where they are those of a closed body, `skin` (b,) is the node of the structure at each of its nodes.
    """

    group: "Membranes"
    fabrics: tuple[str, ...]
    fabric: np.ndarray
    supports: tuple[MembraneSupport, ...]
    pressures: tuple[MembranePressure, ...]
    seams: dict[str, np.ndarray]
    cables: tuple[str, ...]
    remarks: tuple[str, ...]
    skin: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Members:
    """Nodes and elements of a scene.

    `nodes` (n,3) m, `fixed` (n,3) bool, `labels` node names; `chains` groups of elements; `area` (e,) m^2 over all
    elements in the order of the groups, of those whose stiffness follows a modulus, 0 where it is given; `mass` (n,)
    kg is what the elements and point masses bring, `wing_mass` (n,) kg the part that springs and canopy bring. `wing`
    is the mesh of an inflatable wing where the scene has tubes: beams, canopy grid and rigid links. `bending` are
    springs that resist the bending of canopy quads, `membranes` those on a mesh of triangles.
    """

    nodes: np.ndarray
    fixed: np.ndarray
    labels: tuple[str, ...]
    chains: "tuple[Chains, ...]"
    area: np.ndarray
    mass: np.ndarray
    wing_mass: np.ndarray
    wing: WingMesh | None = None
    bending: "tuple[BendingSprings, ...]" = ()
    membranes: MembraneMesh | None = None

    def meshed(self) -> "Members":
        """Without what only the mesher of an inflatable wing and reports know."""
        if self.wing is None:
            return self
        none = np.zeros(0)
        return replace(self, wing=replace(self.wing, labels=(), springs=[], canopy_mass=none, tube_length=none))

    def bare(self) -> "Members":
        """The nodes alone, without elements and names."""
        none = np.zeros(0)
        return Members(self.nodes, np.zeros((0, 3), bool), (), (), none, none, none)

    def node(self, label: str, where: str) -> int:
        """Index of a node; raises `SceneError` naming the row `where` it is asked for."""
        try:
            return self.labels.index(label)
        except ValueError:
            raise SceneError(f"{where}: node '{label}' is not in the node table; add it or correct the name.") from None

    def mass_with(self, wing_mass: float) -> np.ndarray:
        """Lumped masses (n,) kg when springs and canopy weigh `wing_mass` kg in the same proportions."""
        total = float(self.wing_mass.sum())
        return self.mass if total == 0.0 else self.mass + self.wing_mass * (wing_mass / total - 1.0)

    def line_legs(self):
        """Legs (k,2) as nodes of all elements of the line table, sheave by sheave, and their diameters (k,) m."""
        legs, diameter, start = [], [], 0
        for group in self.chains:
            area = self.area[start : start + len(group.l0)]
            start += len(group.l0)
            ropes = group.nodes[area > 0.0]
            pairs = np.stack([ropes[:, :-1], ropes[:, 1:]], axis=2)
            legs.append(pairs.reshape(-1, 2))
            diameter.append(np.repeat(np.sqrt(4.0 / np.pi * area[area > 0.0]), pairs.shape[1]))
        return np.concatenate([_NO_LEGS, *legs]), np.concatenate([_NONE, *diameter])

    @property
    def lines(self) -> np.ndarray:
        """Which elements are lines and ropes of the table, or cables of membranes, (e,) bool: not springs or fabric."""
        if self.membranes is None or not self.membranes.cables:
            return np.asarray(self.area > 0.0)
        return (self.area > 0.0) | np.isin(self.names, self.membranes.cables)

    @property
    def leg_names(self) -> tuple[str, ...]:
        """Name of the element of every leg of `line_legs`."""
        sheaves = [group.nodes.shape[1] - 2 for group in self.chains for _ in group.names]
        return tuple(
            name
            for name, area, more in zip(self.names, self.area, sheaves, strict=True)
            if area > 0.0
            for _ in range(more + 1)
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Element names in the order of the groups."""
        return tuple(n for group in self.chains for n in group.names)


def rigid_members(nodes: np.ndarray) -> Members:
    """Of a scene without a structure: the nodes (n,3) m of its wing, all of them held, and no element."""
    mass, labels = np.zeros(len(nodes)), tuple(str(i + 1) for i in range(len(nodes)))
    return Members(nodes, np.ones((len(nodes), 3), bool), labels, (), _NONE, mass, mass)


@dataclass(frozen=True, eq=False)
class PointLoad:
    """A dead load that a scene offers as parameter `name`, `start` N at first: on each of the `nodes` (k,) in its
    direction of `directions` (k,3), unit vectors.
    """

    name: str
    nodes: np.ndarray
    directions: np.ndarray
    start: float


def with_rest_lengths(chains, rest, stiffness):
    """The chain groups with new rest lengths m and stiffnesses N/m, both over all elements in order."""
    out, start = [], 0
    for group in chains:
        stop = start + len(group.l0)
        out.append(replace(group, l0=rest[start:stop], k=stiffness[start:stop]))
        start = stop
    return tuple(out)
