"""The structural solver of a scene behind blocks: loads in, interface displacements out."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from interface import StepFailed
from structural import (
    Assembly,
    Loads,
    LoadSensitivity,
    Structure,
    equilibrium,
    interface_groups,
    interface_loads,
    line_load_forces,
    mirror_permutation,
    surface_forces,
    tensions,
)

from .checks import symmetric_chains
from .core import Core
from .holding import held_moment, held_place, held_structure, holding_reactions
from .interface import rotated
from .point_loads import read_loads
from .structural_variables import structural_variables
from .symmetry import mirror_images, symmetric_state, symmetrised
from .tapes import Tapes
from .tube_sections import tube_beams, tube_state

# Young's modulus Pa to which lines are softened for the start of a first solve.
EASED = 1e9


class StructuralCore(Core):
    """Static equilibrium of a scene's structure under interface loads and gravity, warm-started from step to step."""

    _hidden: tuple[str, ...] = ("_x", "_fresh", "_solved", "_rotations")
    _inert: tuple[str, ...] = ("solver_tolerance",)

    def __init__(self, scene):
        self._scene = scene
        self._members = scene.members
        self._tapes = Tapes(scene)
        self._interface = scene.interface
        self._pivot, self._held = scene.pivot, held_place(scene)
        self._mirror = mirror_permutation(self._members.nodes)
        self._assemblies: dict[bool, Assembly] = {}
        self._chains = None
        self._beams = None
        self._loads = read_loads(scene)
        variables = structural_variables(scene, self._loads, self._tapes.starts, self._mirror is not None)
        super().__init__(scene.name, tuple(variables))
        self._x, self._rotations = self._start()
        self._show_shape()

    def hints(self):
        """What looks odd with the present parameters: misfits of the design shape, and what breaks its symmetry."""
        from .checks import asymmetry, misfits

        chains, _ = self._present_chains()
        return misfits(self._members.nodes, chains), asymmetry(self._members, chains)

    def _start(self):
        """Positions (n,3) m, and rotations (r,3,3) of the frames where there are some, to start from."""
        nodes, wing = self._members.nodes, self._members.wing
        angle = self._scalar("trim_angle") if "trim_angle" in self._values else 0.0
        turn = self._pivot is not None and angle != 0.0
        x = rotated(nodes, angle, nodes[self._pivot]) if turn else nodes.copy()
        if wing is None:
            return x, None
        about_y = rotated(np.eye(3), angle, np.zeros(3)).T if turn else np.eye(3)
        return x, np.repeat(about_y[None], len(wing.frames), axis=0)

    def _show_shape(self):
        self._put("position", self._x)
        self._put("displacement", self._interface.weights @ self._x - self._interface.nodes)
        chains, _ = self._present_chains()
        tension = np.concatenate([tensions(self._x, c) for c in chains])
        self._put("tension", tension)
        self._put("slack_lines", np.count_nonzero((self._members.area > 0.0) & (tension <= 0.0)))
        if self._members.wing is not None:
            self._show_wing(chains)

    def _show_wing(self, chains):
        legs = [np.linalg.norm(np.diff(self._x[c.nodes], axis=1), axis=2).sum(axis=1) for c in chains]
        self._put("strain", np.concatenate([l / c.l0 - 1.0 for l, c in zip(legs, chains, strict=True)]))
        load, strain = tube_state(self._x, self._rotations, self._present_beams()[0], self._members.wing.tubes.radius)
        self._put("tube_load", load)
        self._put("tube_strain", strain)
        self._put("collapsed_tubes", np.count_nonzero(load >= 1.0))

    def _check(self, block, array):
        if block == "tube_pressure":
            try:
                tube_beams(self._members, self._scene.content["structure"], self._scene.settings, float(array))
            except ValueError as error:
                raise ValueError(f"tube_pressure cannot be {float(array):g} Pa: {error}") from None

    def _parameter_changed(self, block):
        self._chains = self._beams = None
        if self._fresh and block != "trim_angle":
            self._show_shape()
        if block == "trim_angle":
            self._x, self._rotations = self._start()
            self._show_shape()

    def _restored(self):
        self._chains = self._beams = None

    def _present_beams(self):
        """The groups of beams at the present pressure: none, or one."""
        if self._members.wing is None:
            return ()
        if self._beams is None:
            content, settings = self._scene.content["structure"], self._scene.settings
            self._beams = (tube_beams(self._members, content, settings, self._scalar("tube_pressure")),)
        return self._beams

    def _present_chains(self):
        """The chains with the present tape lengths and line modulus, and whether they are mirror-symmetric."""
        if self._chains is None:
            modulus = self._scalar("line_modulus") if "line_modulus" in self._values else None
            chains = self._tapes.chains({name: self._scalar(name) for name in self._tapes}, modulus)
            self._chains = chains, self._mirrored_supports and symmetric_chains(chains, self._mirror)
        return self._chains

    @cached_property
    def _mirrored_supports(self):
        return self._mirror is not None and np.array_equal(self._members.fixed, self._members.fixed[self._mirror])

    def _present_loads(self):
        """The loads of the interface, weights and loads on nodes with their present values."""
        mass = self._members.mass_with(self._scalar("wing_mass") if "wing_mass" in self._values else 0.0)
        weight = mass[:, None] * np.array([0.0, 0.0, -self._scalar("gravity")])
        for name, rows in self._loads.items():
            for node, direction in rows:
                weight[node] += self._scalar(name) * direction
        pressure = self._values.get("pressure", np.zeros(0))
        return Loads(weight, interface_loads(pressure, self._values.get("shear"), self._values.get("line_load")))

    def _groups(self, chains):
        """All groups of elements: the chains, beams at the present pressure, bending springs."""
        return (*chains, *self._present_beams(), *self._members.bending)

    def _is_held(self):
        return "hold_roll_and_yaw" in self._values and bool(self._values["hold_roll_and_yaw"])

    def _assembly(self, symmetric, held):
        assembly = self._assemblies.get((symmetric, held))
        if assembly is None:
            m, i = self._members, self._interface
            loaded = interface_groups(i.weights, i.panels, i.lines)
            structure = Structure(m.nodes, m.fixed, self._groups(m.chains), loaded)
            if m.wing is not None:
                w = m.wing
                clamped = np.zeros((len(w.frames), 3), dtype=bool)
                structure = replace(structure, clamped=clamped, frames=w.frames, riders=w.riders, carriers=w.carriers)
                structure = held_structure(structure, self._held) if held else structure
            assembly = Assembly(structure, self._mirror if symmetric else None)
            self._assemblies[symmetric, held] = assembly
        return assembly

    def step(self, t: float, dt: float) -> None:
        """Equilibrium under the present loads; the same input again returns the stored output without solving."""
        first, self._fresh = self._fresh, False
        if not self._stale:
            self._put("imbalance_before_step", self._values["residual"])
            self._put("newton_iterations", 0)
            return
        self._unsolved()
        chains, mirrored = self._present_chains()
        loads, held = self._present_loads(), self._is_held()
        symmetric = (
            bool(self._values["symmetric"]) and mirrored and symmetric_state(loads, self._x, self._mirror, self._images)
        )
        assembly = self._assembly(symmetric, held)
        tolerance = self._scalar("solver_tolerance")
        beams, x, rotations = self._present_beams(), self._x, self._rotations
        if first and beams:
            x, rotations = self._eased(assembly, chains, loads, beams)
        result = equilibrium(assembly, loads, x, tolerance, groups=self._groups(chains), rotations=rotations)
        if not result.converged:
            moved = np.linalg.norm(result.x - self._x, axis=1)
            raise StepFailed(
                f"static equilibrium not found in {result.iterations} Newton iterations ({result.status}): "
                f"{result.residual:.3g} N out of balance, {tolerance:.3g} N asked for; node "
                f"{self._members.labels[int(np.argmax(moved))]} went furthest, by {moved.max():.3g} m."
            )
        with self._finite_results():
            self._x, self._rotations = result.x, result.rotations
            self._show(result, chains, loads, symmetric)
            if "holding_moment" in self._values:
                self._show_holding(chains, loads, held)
        self._stale, self._solved = False, True

    def directional_derivative(self, changes):
        """Derivative of the displacement along a direction in the loads, at the equilibrium of the last step.

        `changes` maps any of "pressure" (m,) Pa, "shear" (m,3) Pa and "line_load" (k,3) N/m to directions; returns
        {"displacement": (n,3) m}. K dX = H^T df and dx = H dX with the consistent tangent K of elements and follower
        loads (`structural.LoadSensitivity`), factorised once for a state. Where one half is solved, a direction is
        first made mirror-symmetric, because nothing else exists for the half. It changes no state. ValueError in one
        sentence for directions that do not fit, and where the present values have not been solved.
        """
        changes = self._directions(changes)
        symmetric = bool(self._values["symmetry_used"])
        if symmetric:
            panels, lines = self._images
            changes = {k: symmetrised(v, lines if k == "line_load" else panels) for k, v in changes.items()}
        if self._linearised is None:
            self._linearised = self._linearisation(symmetric)
        pressure = changes.get("pressure", np.zeros(len(self._interface.panels)))
        on = interface_loads(pressure, changes.get("shear"), changes.get("line_load"))
        change = Loads(np.zeros_like(self._x), on)
        return {"displacement": self._interface.weights @ self._linearised(change)}

    def _linearisation(self, symmetric):
        (chains, _), loads, held = self._present_chains(), self._present_loads(), self._is_held()
        reaction = held_moment(*self._free_residual(chains, loads), self._held, self._rotations) if held else None
        at = self._x, self._groups(chains), self._rotations
        return LoadSensitivity(self._assembly(symmetric, held), loads, *at, reaction)

    def _eased(self, assembly, chains, loads, beams):
        """Positions and rotations to start the first solve from: the equilibrium with softened lines.

        In the design shape of a full bridle many lines are far off their rest lengths; stiff ones make Newton crawl
        from kink to kink. Softened to EASED they let the kite find its pose, from where the stiff ones are near. Only
        the start depends on it.
        """
        soft = []
        start = 0
        for group in chains:
            area = self._members.area[start : start + len(group.l0)]
            start += len(group.l0)
            k = np.where(area > 0.0, np.minimum(group.k, EASED * area / group.l0), group.k)
            soft.append(replace(group, k=k))
        if all(np.array_equal(a.k, b.k) for a, b in zip(soft, chains, strict=True)):
            return self._x, self._rotations
        pressure = np.abs(loads.on["panels"].pressure).sum() if "panels" in loads.on else 0.0
        force = float(np.linalg.norm(loads.dead)) + float(pressure)
        near = equilibrium(
            assembly, loads, self._x, max(1e-3, 1e-6 * force), groups=self._groups(soft), rotations=self._rotations
        )
        return (near.x, near.rotations) if near.converged else (self._x, self._rotations)

    def _show_holding(self, chains, loads, held):
        """Reactions of the held node and frame: what the free structure is out of balance by."""
        force, moment = 0.0, np.zeros(3)
        if held:
            free, r = self._free_residual(chains, loads)
            about = np.zeros(3) if self._pivot is None else self._members.nodes[self._pivot]
            force, moment = holding_reactions(free, r, self._x, self._held, about)
        self._put("holding_force", force)
        self._put("holding_moment", moment)

    def _free_residual(self, chains, loads):
        """The assembly without the hold, and what it is out of balance by (q,)."""
        free = self._assembly(False, False)
        prepared = free.prepare(loads, self._groups(chains))
        return free, free.residual(free.unknowns.restrict(self._x), prepared, self._rotations)[0]

    @cached_property
    def _images(self):
        return mirror_images(self._interface)

    def _show(self, result, chains, loads, symmetric):
        self._show_shape()
        surface = self._interface.weights @ self._x
        corners = surface[self._interface.panels]
        panels, lines = loads.on.get("panels"), loads.on.get("lines")
        external = loads.dead.sum(axis=0)
        if panels is not None:
            external = surface_forces(corners, panels.pressure, panels.shear).sum(axis=(0, 1)) + external
        if lines is not None:
            external = external + line_load_forces(surface[self._interface.lines], lines.per_length).sum(axis=(0, 1))
        self._put("support_force", external)
        self._put("residual", result.residual)
        self._put("imbalance_before_step", result.residuals[0])
        self._put("unstable_modes", result.unstable_modes)
        self._put("newton_iterations", result.iterations)
        self._put("symmetry_used", float(symmetric))
