"""The structure of a scene: elements, loads and half models for present values, and the outputs that show a shape."""

import operator
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from interface.mirror import mirror_permutation
from interface.validity import Criterion, outside, outside_variable, worst
from interface.vectors import rotated
from structural import (
    Assembly,
    Beams,
    Configuration,
    Loads,
    Structure,
    breukels_tube,
    inflatable_tube,
    interface_groups,
    interface_loads,
    line_load_forces,
    reference_axes,
    surface_forces,
)

from .heading import inward
from .holding import held_place, held_structure
from .symmetry import mirror_images, symmetric_groups, symmetric_state
from .tapes import Tapes

OF_CHAINS = ("tension", "length", "strain")  # outputs that are what chains measure


class Memoised:
    """The last result of a function of arrays, until one of them is another array; values are never changed in place.

    The function comes with each call: kept, it would tie what owns it into a circle that outlives its last use.
    """

    def __init__(self) -> None:
        self._arguments: tuple[Any, ...] | None = None
        self._result: Any = None

    def __call__(self, make: Callable[..., Any], *arguments: Any) -> Any:
        last = self._arguments
        if last is None or len(last) != len(arguments) or any(map(operator.is_not, last, arguments)):
            self._result, self._arguments = make(*arguments), arguments
        return self._result


class StructuralModel:
    """What a static and a transient core share. It has no state: all follows from values of blocks and a shape.

    Shapes are in the axes of the kite (see `Heading`), where its plane of symmetry is y = 0; what `shown` gives is in
    the global ones. `members` and `interface` are those of the scene, in the axes of the kite, `mirror` (n,) the images
    of its nodes or None, `held` the node and nodal rotation at which roll and yaw can be held or None.
    """

    def __init__(self, scene):
        self.scene, self.pivot, self.heading = scene, scene.pivot, scene.heading
        home = self.heading.home
        self.members = replace(scene.members, nodes=home(scene.members.nodes))
        self.interface = replace(scene.interface, nodes=home(scene.interface.nodes))
        self.tapes, self.held = Tapes(scene), held_place(scene, self.members)
        self.mirror = mirror_permutation(self.members.nodes)
        self.membranes = _membranes(self.members)
        self._assemblies: dict[tuple[bool, bool], Assembly] = {}
        self._beams, self._chains, self._groups, self._symmetric = (Memoised() for _ in range(4))

    # Elements

    def beams(self, values):
        """The groups of beams at the present pressure: none, or one."""
        return () if self.members.wing is None else self._beams(self._tube_beams, values["tube_pressure"])

    def _tube_beams(self, pressure):
        return (self.tubes_at(float(pressure)),)

    def tubes_at(self, pressure):
        """The beams of all tubes at a pressure Pa; ValueError in one sentence where their law has no answer."""
        return tube_beams(self.members, self.scene.structure, self.scene.choices.tube_law, pressure)

    def chains(self, values):
        """The chains with the present tape lengths and line modulus."""
        return self._chains(self._tape_chains, values.get("line_modulus"), *(values[name] for name in self.tapes))

    def _tape_chains(self, modulus, *lengths):
        given = {name: float(v) for name, v in zip(self.tapes, lengths, strict=True)}
        return self.tapes.chains(given, None if modulus is None else float(modulus))

    def groups(self, values):
        """All groups of elements: chains, beams, bending springs."""
        return self._groups(self._all_groups, self.chains(values), self.beams(values))

    def with_chains(self, values, chains):
        """All groups of elements, with other chains than the present ones."""
        return self._all_groups(chains, self.beams(values))

    def _all_groups(self, chains, beams):
        more = () if self.membranes is None else self.membranes.groups
        return (*chains, *beams, *self.members.bending, *more)

    # Symmetry

    def symmetric(self, values, groups, loads, x):
        """Whether one half is to be solved: asked for, and elements, supports, `loads` and shape x (n,3) m are."""
        if not (bool(values["symmetric"]) and self._mirrored_supports):
            return False
        if not self._symmetric(self._symmetric_groups, *groups):
            return False
        return all(symmetric_state(one, x, self.mirror, self.images) for one in loads)

    @cached_property
    def _mirrored_supports(self):
        if self.mirror is None or not np.array_equal(self.members.fixed, self.members.fixed[self.mirror]):
            return False
        return self.membranes is None or self.membranes.mirrored(self.mirror)

    def _symmetric_groups(self, *groups):
        return symmetric_groups(groups, self.mirror, self._structure.rotation_nodes)

    @cached_property
    def images(self):
        """Mirror images of panels and lines of the interface; None where one has none."""
        return mirror_images(self.interface)

    def assembly(self, symmetric, held=False):
        """The assembly of the whole or one half, with roll and yaw held or not; each is made once."""
        if (symmetric, held) not in self._assemblies:
            structure = held_structure(self._structure, self.held) if held else self._structure
            self._assemblies[symmetric, held] = Assembly(structure, self.mirror if symmetric else None)
        return self._assemblies[symmetric, held]

    @cached_property
    def _structure(self):
        m, i, w = self.members, self.interface, self.members.wing
        panels = i.panels
        if self.membranes is not None and np.array_equal(panels[:, 2], panels[:, 3]):
            panels = panels[:, :3]  # with nothing but triangles, which are cheaper
        loaded = interface_groups(i.weights, panels, i.lines)
        loaded |= {} if self.membranes is None else self.membranes.load_groups
        if w is None:
            return Structure(m.nodes, m.fixed, self._all_groups(m.chains, ()), loaded)
        beams = self.tubes_at(self.scene.structure.tube_pressure)
        free = np.zeros((len(w.rotation_nodes), 3), dtype=bool)
        groups = self._all_groups(m.chains, (beams,))
        links = w.dependent_nodes, w.link_rotations
        return Structure(m.nodes, m.fixed, groups, loaded, w.rotation_nodes, free, *links)

    # Loads

    def mass(self, values):
        """Masses (n,) kg of the nodes."""
        return self.members.mass_with(float(values["wing_mass"]) if "wing_mass" in values else 0.0)

    def loads(self, values, more_mass=None):
        """Loads of the interface, weights and loads on nodes with their present values; `more_mass` (n,) kg adds
        weight.
        """
        gravity, axes = float(values["gravity"]), self.heading.axes(values)
        dead = self.mass(values)[:, None] * np.array([0.0, 0.0, -gravity])
        for load in self.scene.point_loads:
            np.add.at(dead, load.nodes, float(values[load.name]) * inward(load.directions, axes))
        if more_mass is not None:
            dead[:, 2] -= more_mass * gravity
        pressure = values.get("pressure")
        shear, line_load = (inward(values.get(name), axes) for name in ("shear", "line_load"))
        if self.membranes is None:
            return Loads(dead, interface_loads(pressure, shear, line_load))
        idle = shear is None and not np.any(pressure)  # as most often where membranes have pressures of their own
        on = interface_loads(None if idle else pressure, shear, line_load)
        return Loads(dead, on | self.membranes.loads(values))

    def membrane_reactions(self, values, groups, loads, x, rotations):
        """Outputs of the forces on groups of supports of membranes, in equilibrium at x (n,3) m."""
        if self.membranes is None:
            return {}
        structure = replace(self._structure, groups=groups)
        return self.membranes.reactions(structure, x, loads, rotations, self.heading.axes(values))

    def external_force(self, loads, x):
        """Force (3,) N of all loads together in node positions x (n,3) m, in the axes of the kite."""
        points, force = self.interface.weights @ x, loads.dead.sum(axis=0)
        if "panels" in loads.on:
            on = loads.on["panels"]
            corners = points[self.interface.panels]
            force = surface_forces(corners, on.pressure, on.shear).sum(axis=(0, 1)) + force
        if "lines" in loads.on:
            on = loads.on["lines"]
            force = force + line_load_forces(points[self.interface.lines], on.per_length).sum(axis=(0, 1))
        for name, faces in () if self.membranes is None else self.membranes.load_groups.items():
            if name in loads.on:
                force = force + faces.forces(x[faces.nodes], loads.on[name]).sum(axis=(0, 1))
        return force

    # Shapes

    def start(self, values):
        """Positions (n,3) m, and nodal rotations (r,3,3) where there are some, to start from."""
        nodes, wing = self.members.nodes, self.members.wing
        angle = float(values["trim_angle"]) if "trim_angle" in values else 0.0
        turn = self.pivot is not None and angle != 0.0
        x = rotated(nodes, angle, nodes[self.pivot]) if turn else nodes.copy()
        if wing is None:
            return x, None
        about_y = rotated(np.eye(3), angle, np.zeros(3)).T if turn else np.eye(3)
        return x, np.repeat(about_y[None], len(wing.rotation_nodes), axis=0)

    def shown(self, values, x, rotations, chains=None):
        """Outputs that follow from a shape: positions x (n,3) m, nodal `rotations` (r,3,3) or None; of the present
        chains, or of others.
        """
        chains = self.chains(values) if chains is None else chains
        axes, groups = self.heading.axes(values), self.with_chains(values, chains)
        measured = [group.measured(Configuration(x, rotations)) for group in groups]
        of_chains = {k: _joined(m[k] for m in measured[: len(chains)]) for k in OF_CHAINS}
        out = {
            "position": self.heading.placed(x, axes),
            "displacement": self.heading.placed(self.interface.weights @ x, axes) - self.scene.interface.nodes,
            "rest_length": _joined(c.l0 for c in chains),
            "axial_stiffness": _joined(c.k * c.l0 for c in chains),
            "slack_lines": np.count_nonzero(self.members.lines & (of_chains["tension"] <= 0.0)),
        }
        judged = self._judged(groups, measured)
        out |= of_chains | self._verdict(judged)
        if self.membranes is not None:
            out |= self.membranes.shown(measured[-1], x, axes)
        if self.members.wing is None:
            return out
        load, ends = judged["largest_moment_over_collapse"], self.members.wing.tubes.ends
        return out | {
            "tube_load": load,
            "tube_strain": judged["largest_tube_strain"],
            "collapsed_tubes": np.count_nonzero(load >= 1.0),
            "tube_length": np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1),
            "tube_rest_length": self.beams(values)[0].l0,
        }

    # Up to where the model is known to be good

    @cached_property
    def _criteria(self) -> dict[Criterion, str]:
        """What the elements are judged by -> what the places of its values count."""
        try:
            groups = self._structure.groups
        except ValueError:  # of a pressure that no tube has: the check of start values says so
            return {}
        found = {}
        for group in groups:
            for criterion in group.criteria:
                family = [g for g in groups if type(g) is type(group)]
                labels = tuple(g.label(row) for g in family for row in range(len(g)))
                found[replace(criterion, labels=labels)] = group.counted
        return found

    @property
    def criteria(self):
        """What the elements are judged by, with the names that places count."""
        return tuple(self._criteria)

    def validity_variables(self):
        """The outputs that say how far the elements are within what they are known to be good for."""
        for criterion, counted in self._criteria.items():
            yield from criterion.variables(counted)
        yield outside_variable()

    def _judged(self, groups, measured):
        """Name of criterion -> values of all elements of the families that have it, from what each group `measured`."""
        found = [(type(g), len(g), g.judged(m)) for g, m in zip(groups, measured, strict=True)]
        families = {name: family for family, _, values in found for name in values}
        return {
            name: np.concatenate([values.get(name, np.zeros(count)) for of, count, values in found if of is family])
            for name, family in families.items()
        }

    def _verdict(self, judged):
        """The outputs of `validity_variables`."""
        out = {}
        for criterion in self._criteria:
            out[criterion.name], out[criterion.place] = worst(judged[criterion.name])
        return out | {"outside_validity": outside(self._criteria, out)}

    def softened(self, chains, modulus):
        """The chains with lines of at most this modulus Pa; None where that changes none."""
        soft, start = [], 0
        for group in chains:
            area = self.members.area[start : start + len(group)]
            start += len(group)
            k = np.where(area > 0.0, np.minimum(group.k, modulus * area / group.l0), group.k)
            soft.append(replace(group, k=k))
        same = all(np.array_equal(a.k, b.k) for a, b in zip(soft, chains, strict=True))
        return None if same else tuple(soft)


def _joined(arrays):
    """One array (e,) of the arrays of all groups of chains, which there may be none of."""
    return np.concatenate([np.zeros(0), *arrays])


def _membranes(members):
    """What the membranes of a scene add, None without: their code is loaded with them only."""
    if members.membranes is None:
        return None
    from .membranes import MembraneModel

    return MembraneModel(members.membranes, members.nodes)


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
