"""The members of a scene from its tables: nodes, elements in groups and masses, checked and at the scene's scale."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from structural import Chains

from ..builders.bridles import PILOT
from ..checks import free_line_ends
from ..interface import Interface
from ..members import Members, PointLoad
from ..schema import BridleInput, Choices, MembranesInput, SceneError, StructureInput
from .elements import Element, canopy_bending, canopy_quads, lines, mass_shares, point_masses, springs
from .inflatable_wing import read_wing_mesh
from .tables import name, number, read_table

if TYPE_CHECKING:
    from ..builders.wings import ClosedSurface

NEEDED = ("ribs", "tube_pressure", "canopy_stiffness", "canopy_shear_stiffness")
OF_FABRIC = ("tube_stiffness", "tube_shear_stiffness")
# Keys and settings that say nothing without tubes, and settings that say nothing with them.
_ONLY_TUBES = (*NEEDED, *OF_FABRIC, "attachments", "wing_mass", "canopy_density", "hold")
_TUBE_SETTINGS = ("canopy_stations", "canopy_subdivisions", "tube_law")
_STRUT_SETTINGS = ("chord", "panels_per_section")
_MEMBRANE_SETTINGS = ("cells", "order", "wrinkling")


def read_members(
    folder: Path,
    structure: StructureInput,
    choices: Choices,
    offered: Iterable[str],
    wind: tuple[float, ...],
    membranes: MembranesInput | None = None,
    surface: "ClosedSurface | None" = None,
    bridle: BridleInput | None = None,
) -> Members:
    """All members of the sections [structure] and [membranes], checked: missing and duplicate nodes and names, parts
    that nothing holds.

    `offered` are the names of the settings that the scene has, `wind` its direction, which tells left from right,
    `surface` that of [body], in the scale of the tables, which may hang on the lines of a `bridle`.
    """
    check_wing_keys(folder, structure, choices, offered)
    check_membrane_settings(folder, offered, membranes)
    labels, nodes, fixed = _nodes(folder, structure, membranes)
    if bridle is not None:
        from .bridles import bridle_lines, read_bridle  # not loaded for scenes without

        hung = read_bridle(folder, bridle, surface)
        labels, nodes, fixed, membranes = _with_bridle(folder, bridle, hung, membranes, labels, nodes, fixed)
    wing = None
    if structure.tubes:
        mesh = choices.canopy_stations, choices.canopy_subdivisions
        wing = read_wing_mesh(folder, structure, labels, nodes, fixed, *mesh, wind)
        labels, nodes = wing.labels, wing.nodes
        fixed = np.concatenate([fixed, np.zeros((len(nodes) - len(fixed), 3), dtype=bool)])
    placed = None
    if membranes is not None:
        from .membranes import read_membranes  # not loaded for scenes without

        alone = bridle is None and not any(getattr(structure, key) for key in ("springs", "canopy", "lines", "tubes"))
        weighs = structure.masses is not None or any(f.density for f in membranes.fabrics.values())
        dead = structure.loads is not None or (weighs and structure.gravity != 0.0)
        own = labels, nodes, fixed, alone, dead
        placed = read_membranes(folder, membranes, choices, *own, surface)
        labels, nodes, fixed = placed.labels, placed.nodes, placed.fixed
    table_index = {label: i for i, label in enumerate(labels)}
    elements: list[Element] = []
    taken: dict[str, str] = {}
    declared = [
        read(folder / getattr(structure, key), table_index, nodes, structure)
        for key, read in (("springs", springs), ("canopy", canopy_quads), ("lines", lines))
        if getattr(structure, key)
    ]
    if bridle is not None:
        declared.append(bridle_lines(folder, hung, structure, table_index, nodes))
    for element, where in chain(*declared, () if placed is None else placed.cables):
        if element.name in taken:
            raise SceneError(f"{where}: the name '{element.name}' stands already in {taken[element.name]}; rename.")
        taken[element.name] = where
        elements.append(element)
    if wing is not None:
        for label, ends, l0, k in wing.springs:
            if label in taken:
                raise SceneError(f"{taken[label]}: the canopy of the wing has a part named '{label}'; rename the row.")
            elements.append(Element(label, ends, l0, k, 0.0, False, 0.0, True))
    if not elements and placed is None:
        raise SceneError(f"{folder.name}/scene.toml: [structure] names no springs, canopy or lines; add a table.")
    mass, of_wing = _masses(folder, structure, bridle, wing, elements, table_index, nodes)
    skin = None if placed is None else placed.membranes
    if skin is not None:
        mass = mass + skin.group.nodal_masses(len(nodes))
    check_connected(folder, structure, labels, fixed, elements, wing, skin)
    groups, area = _grouped(elements)
    bending = _bending(folder, structure, table_index, nodes)
    members = Members(nodes, fixed, tuple(labels), groups, area, mass + of_wing, of_wing, wing, bending, skin)
    return members if choices.scale == 1.0 else _scaled(members, float(choices.scale))


def _masses(folder, structure, bridle, wing, elements, index, nodes):
    """Masses (n,) kg that elements, control unit and the table bring, and those of springs and canopy."""
    mass = np.zeros(len(nodes))
    of_wing = np.zeros(len(nodes))
    if wing is not None:
        of_wing[: len(wing.nodes)] = wing_masses(folder, structure, wing)
    for e in elements:
        share = mass_shares(nodes[list(e.nodes)]) * e.mass
        np.add.at(of_wing if e.two_way else mass, list(e.nodes), share)
    if bridle is not None:
        mass[index[PILOT]] += bridle.control_unit_mass
    if structure.masses:
        point_masses(folder / structure.masses, index, mass)
    return mass, of_wing


def _with_bridle(folder, given, lines, membranes, labels, nodes, fixed):
    """Labels, places and supports of the nodes of the tables and of a bridle; the membranes with where it begins."""
    if twice := lines.nodes.keys() & set(labels):
        raise SceneError(
            f"{folder.name}/scene.toml: [bridle] has a node '{min(twice)}' of its own; rename that of the table."
        )
    held = np.array([[name in lines.held] * 3 for name in lines.nodes])
    membranes = replace(membranes, attachments=membranes.attachments | given.rows)
    places = np.array(list(lines.nodes.values()))
    return (*labels, *lines.nodes), np.concatenate([nodes, places]), np.concatenate([fixed, held]), membranes


def _bending(folder, structure, index, nodes):
    stiffness = structure.canopy_bending_stiffness
    if stiffness is None:
        return ()
    if not structure.canopy:
        where = f"{folder.name}/scene.toml: [structure] canopy_bending_stiffness"
        raise SceneError(f"{where} is that of a table 'canopy' of quads; add one or drop it.")
    return canopy_bending(folder / structure.canopy, index, nodes, stiffness)


def _scaled(members, factor):
    """A geometrically similar kite: lengths and diameters by the factor, fabrics the same.

    All masses go with the square of the factor, as those of the fabric do; stiffnesses of springs and fabric stay,
    those of lines follow their modulus.
    """
    wing = members.wing
    if wing is not None:
        tubes = replace(wing.tubes, radius=factor * wing.tubes.radius)
        wing = replace(wing, nodes=factor * wing.nodes, tubes=tubes)
    skin = members.membranes
    if skin is not None:
        skin = replace(skin, group=replace(skin.group, pattern=factor * skin.group.pattern))
    groups, start = [], 0
    for group in members.chains:
        line = members.lines[start : start + len(group.l0)]
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
        membranes=skin,
    )


def _nodes(folder, structure, membranes):
    """Labels, places (n,3) m and supports (n,3) of the table of nodes; none where membranes alone make up a scene."""
    if structure.nodes is None:
        if structure.tubes:
            raise SceneError(f"{folder.name}/scene.toml: [structure] lacks 'nodes', which 'tubes' needs; add it.")
        return (), np.zeros((0, 3)), np.zeros((0, 3), dtype=bool)
    path = folder / structure.nodes
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
    if not fixed.any() and (membranes is None or not membranes.supports):
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
                canopy=np.array([e.fabric for e in part], bool) if any(e.fabric for e in part) else None,
            )
        )
    return tuple(groups), np.array([elements[i].area for i in order])


def check_wing_keys(folder, structure, choices, offered):
    """`SceneError` in one sentence where a key or a setting is missing for the kind of wing, or means nothing to it."""
    label, tubes = f"{folder.name}/scene.toml", bool(structure.tubes)
    if not tubes and (odd := [key for key in _ONLY_TUBES if getattr(structure, key)]):
        raise SceneError(f"{label}: [structure] {odd[0]} means nothing without 'tubes'; add these or remove it.")
    for key in _STRUT_SETTINGS if tubes else _TUBE_SETTINGS:
        if key in offered:
            kind = "tubes and ribs" if tubes else "springs and struts"
            raise SceneError(f"{label}: [settings.{key}] means nothing to a wing of {kind}; remove it.")
    if not tubes:
        return
    fabric = OF_FABRIC if choices.tube_law == "fabric" else ()
    for key in (*NEEDED, *fabric):
        if getattr(structure, key) is None:
            raise SceneError(f"{label}: [structure] lacks '{key}', which tubes need; add it.")
    if structure.tube_pressure <= 0.0:
        raise SceneError(
            f"{label}: [structure] tube_pressure must be above zero; give the pressure in the tubes less that of the "
            "air around them, in Pa."
        )
    for key, least in (("canopy_stations", 2), ("canopy_subdivisions", 1)):
        value = getattr(choices, key)
        if not isinstance(value, int) or value < least:
            raise SceneError(f"{label}: [settings.{key}] must be a whole number, {least} or more; it is {value}.")


def check_membrane_settings(folder, offered, membranes):
    """`SceneError` in one sentence where a setting of membranes is offered, and there are none."""
    for key in _MEMBRANE_SETTINGS if membranes is None else ():
        if key in offered:
            raise SceneError(
                f"{folder.name}/scene.toml: [settings.{key}] means nothing without [membranes]; remove it."
            )


def wing_masses(folder, structure, wing):
    """Masses (n,) kg of the wing: the canopy by its area, the rest of `wing_mass` along the tubes (LEI thesis 6.2)."""
    canopy = float(wing.canopy_mass.sum())
    total = canopy if structure.wing_mass is None else structure.wing_mass
    if total < canopy:
        raise SceneError(
            f"{folder.name}/scene.toml: [structure] wing_mass of {total:g} kg is less than the canopy's {canopy:.3g} "
            "kg; correct wing_mass or canopy_density."
        )
    return wing.canopy_mass + (total - canopy) * wing.tube_length / wing.tube_length.sum()


def check_connected(folder, structure, labels, fixed, elements, wing, membranes=None):
    """Every free node belongs to an element, and whatever hangs together is held somewhere."""
    where = f"{folder.name}/{structure.nodes or 'scene.toml [membranes]'}"
    joined = [e.nodes for e in elements]
    if membranes is not None:
        joined += membranes.group.nodes.tolist()
    if wing is not None:
        links = zip(wing.dependent_nodes, wing.rotation_nodes[wing.link_rotations], strict=True)
        joined += [*map(tuple, wing.tubes.ends), *links]
    used = np.zeros(len(labels), dtype=bool)
    used[[n for nodes in joined for n in nodes]] = True
    for n, label in enumerate(labels):
        if not used[n] and not fixed[n].all():
            raise SceneError(f"{where}: node '{label}' belongs to no element; connect or remove it.")
    pairs = np.array([pair for nodes in joined for pair in pairwise(nodes)]).T
    graph = sp.coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(len(labels), len(labels)))
    count, part = connected_components(graph, directed=False)
    supported = np.bincount(part, fixed.any(axis=1), minlength=count) > 0.0
    for n, label in enumerate(labels):
        if not supported[part[n]] and used[n]:
            raise SceneError(
                f"{where}: the part with node '{label}' hangs on no fixed node; connect it to the rest or fix one of "
                "its nodes."
            )


def check_line_ends(
    folder: Path, structure: StructureInput, members: Members, loads: Iterable[PointLoad], interface: Interface
) -> None:
    """`SceneError` in one sentence where a line ends in a free node on which nothing else pulls: no other element, no
    mass, no load of the table, no part of the interface and so no flow. Such a line can only be slack.
    """
    acted = members.mass > 0.0
    acted[interface.weights.indices] = True
    for load in loads:
        acted[load.nodes] = True
    for element, node in free_line_ends(members):
        if not acted[node]:
            line, table = members.names[element], read_table(folder / str(structure.lines), {"name": name})
            raise SceneError(
                f"{table.at(table['name'].index(line))}: line '{line}' dangles at node '{members.labels[node]}', where "
                "nothing pulls; connect that end or fix the node, or give it weight (masses, line_density) or a load "
                "(loads)."
            )
