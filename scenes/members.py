"""The members of a scene: nodes, elements in groups and masses, at the scene's scale."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from structural import BendingSprings, Chains

from .connections import check_connected
from .element_tables import Element, canopy_bending, canopy_quads, lines, mass_shares, point_masses, springs
from .tables import SceneError, name, number, read_table
from .wing_mesh import WingMesh
from .wing_tables import check_wing_keys, wing_masses, wing_of


@dataclass(frozen=True, eq=False)
class Members:
    """Nodes and elements of a scene.

    `nodes` (n,3) m, `fixed` (n,3) bool, `labels` node names; `chains` groups of elements; `area` (e,) m^2 over all
    elements in the order of the groups, of those whose stiffness follows a modulus, 0 where it is given; `mass` (n,)
    kg is what the elements and point masses bring, `wing_mass` (n,) kg the part that springs and canopy bring. `wing`
    is the mesh of an inflatable wing where the scene has tubes: beams, canopy grid and rigid links. `bending` are
    springs that resist the bending of canopy quads.
    """

    nodes: np.ndarray
    fixed: np.ndarray
    labels: tuple[str, ...]
    chains: tuple[Chains, ...]
    area: np.ndarray
    mass: np.ndarray
    wing_mass: np.ndarray
    wing: WingMesh | None = None
    bending: tuple[BendingSprings, ...] = ()

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
        return np.concatenate(legs), np.concatenate(diameter)

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


def read_members(folder: Path, structure: dict[str, Any], settings: dict[str, Any] | None = None) -> Members:
    """All members of the [structure] section, checked: missing and duplicate nodes and names, dangling lines."""
    settings = settings or {}
    check_wing_keys(folder, structure, settings)
    labels, nodes, fixed = _nodes(folder / structure["nodes"])
    wing = None
    if structure["tubes"]:
        wing = wing_of(folder, structure, settings, labels, nodes, fixed)
        labels, nodes = wing.labels, wing.nodes
        fixed = np.concatenate([fixed, np.zeros((len(nodes) - len(fixed), 3), dtype=bool)])
    table_index = {label: i for i, label in enumerate(labels)}
    elements: list[Element] = []
    taken: dict[str, str] = {}
    for key, read in (("springs", springs), ("canopy", canopy_quads), ("lines", lines)):
        if structure[key]:
            for element, where in read(folder / structure[key], table_index, nodes, structure):
                if element.name in taken:
                    raise SceneError(
                        f"{where}: the name '{element.name}' stands already in {taken[element.name]}; rename."
                    )
                taken[element.name] = where
                elements.append(element)
    if wing is not None:
        for label, ends, l0, k in wing.springs:
            if label in taken:
                raise SceneError(f"{taken[label]}: the canopy of the wing has a part named '{label}'; rename the row.")
            elements.append(Element(label, ends, l0, k, 0.0, False, 0.0, True))
    if not elements:
        raise SceneError(f"{folder.name}/scene.toml: [structure] names no springs, canopy or lines; add a table.")
    mass = np.zeros(len(nodes))
    of_wing = np.zeros(len(nodes)) if wing is None else wing_masses(folder, structure, wing)
    for e in elements:
        share = mass_shares(nodes[list(e.nodes)]) * e.mass
        np.add.at(of_wing if e.two_way else mass, list(e.nodes), share)
    if structure["masses"]:
        point_masses(folder / structure["masses"], table_index, mass)
    check_connected(folder, structure, labels, fixed, elements, wing)
    groups, area = _grouped(elements)
    bending = _bending(folder, structure, table_index, nodes)
    members = Members(nodes, fixed, tuple(labels), groups, area, mass + of_wing, of_wing, wing, bending)
    return members if settings.get("scale", 1.0) == 1.0 else _scaled(members, float(settings["scale"]))


def _bending(folder, structure, index, nodes):
    stiffness = structure["canopy_bending_stiffness"]
    if stiffness is None:
        return ()
    if not structure["canopy"]:
        where = f"{folder.name}/scene.toml: [structure] canopy_bending_stiffness"
        raise SceneError(f"{where} is that of a table 'canopy' of quads; add one or drop it.")
    return canopy_bending(folder / structure["canopy"], index, nodes, stiffness)


def _scaled(members, factor):
    """A geometrically similar kite: lengths and diameters by the factor, fabrics the same.

    All masses go with the square of the factor, as those of the fabric do; stiffnesses of springs and fabric stay,
    those of lines follow their modulus.
    """
    wing = members.wing
    if wing is not None:
        tubes = replace(wing.tubes, radius=factor * wing.tubes.radius)
        wing = replace(wing, nodes=factor * wing.nodes, tubes=tubes)
    groups, start = [], 0
    for group in members.chains:
        line = members.area[start : start + len(group.l0)] > 0.0
        start += len(group.l0)
        groups.append(replace(group, l0=factor * group.l0, k=np.where(line, factor * group.k, group.k)))
    bending = tuple(replace(b, arms=factor * b.arms, k=b.k) for b in members.bending)  # EI ~ width, k = EI / arm
    return replace(
        members,
        nodes=factor * members.nodes,
        bending=bending,
        chains=tuple(groups),
        area=factor**2 * members.area,
        mass=factor**2 * members.mass,
        wing_mass=factor**2 * members.wing_mass,
        wing=wing,
    )


def _nodes(path: Path):
    table = read_table(path, {"node": name, "x_m": number, "y_m": number, "z_m": number, "fixed": _directions})
    seen: dict[str, int] = {}
    for row, label in enumerate(table["node"]):
        if label in seen:
            raise SceneError(
                f"{table.at(row)}: node '{label}' stands already in row {table.lines[seen[label]]}; rename it."
            )
        seen[label] = row
    nodes = np.array([table["x_m"], table["y_m"], table["z_m"]]).T
    fixed = np.array([[axis in f for axis in "xyz"] for f in table["fixed"]])
    if not fixed.any():
        raise SceneError(
            f"{table.path.parent.name}/{path.name}: no node is fixed; put xyz into 'fixed' of at least one."
        )
    return tuple(table["node"]), nodes, fixed


def _directions(text: str) -> str:
    if set(text) - set("xyz"):
        raise ValueError
    return text


def _grouped(elements):
    order = sorted(range(len(elements)), key=lambda i: len(elements[i].nodes))
    groups = []
    for size in sorted({len(e.nodes) for e in elements}):
        part = [elements[i] for i in order if len(elements[i].nodes) == size]
        groups.append(
            Chains(
                np.array([e.nodes for e in part]),
                np.array([e.l0 for e in part], float),
                np.array([e.k for e in part], float),
                np.array([e.two_way for e in part], bool),
                tuple(e.name for e in part),
            )
        )
    return tuple(groups), np.array([elements[i].area for i in order])


def with_rest_lengths(chains, rest, stiffness):
    """The chain groups with new rest lengths m and stiffnesses N/m, both over all elements in order."""
    out, start = [], 0
    for group in chains:
        stop = start + len(group.l0)
        out.append(replace(group, l0=rest[start:stop], k=stiffness[start:stop]))
        start = stop
    return tuple(out)
