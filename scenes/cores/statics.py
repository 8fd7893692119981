"""The structural solver of a quasi-static scene: loads in, interface displacements out."""

from dataclasses import dataclass, replace

import numpy as np

from interface import StepFailed
from interface.mirror import symmetrised
from structural import Loads, LoadSensitivity, equilibrium, interface_loads

from .core import Result, Solver
from .heading import inward, outward
from .holding import held_moment, holding_reactions
from .structural_variables import static_variables
from .structure import StructuralModel

# Young's modulus Pa to which lines are softened for the start of a first solve.
START_MODULUS = 1e9
# The same, one after the other, where that start does not lead to the equilibrium.
STIFFENED = (START_MODULUS, 3e9, 3e10)


@dataclass(frozen=True, eq=False)
class Shape:
    """Positions `x` (n,3) m and nodal `rotations` (r,3,3), None without any: where the next solve starts."""

    x: np.ndarray
    rotations: np.ndarray | None


class Statics(Solver):
    """Static equilibrium of a scene's structure under interface loads and gravity, warm-started from step to step."""

    inexact = ("solver_tolerance",)

    def __init__(self, scene):
        self.name, self.model = scene.name, StructuralModel(scene)
        self.variables = tuple(static_variables(scene, self.model))
        self.criteria = self.model.criteria

    def check(self, block, array):
        """See Solver."""
        if block == "tube_pressure":
            try:
                self.model.tubes_at(float(array))
            except ValueError as error:
                raise ValueError(f"tube_pressure cannot be {float(array):g} Pa: {error}") from None

    def begin(self, values):
        """See Solver."""
        shape = Shape(*self.model.start(values))
        return Result(self.model.shown(values, shape.x, shape.rotations), shape)

    def follow(self, block, values, state, started):
        """See Solver."""
        if block in ("trim_angle", "start_azimuth"):
            return self.begin(values)
        return Result() if started else Result(self.model.shown(values, state.x, state.rotations))

    def repeated(self, values, state, first, t, dt):
        """See Solver."""
        return Result({"imbalance_before_step": values["residual"], "newton_iterations": 0})

    def must_step(self, values, state, t, dt):
        """See Solver: in pseudo-time the shape moves on under the same loads."""
        return float(values["pseudo_damping"]) > 0.0

    def step(self, values, state, first, t, dt):
        """Equilibrium under the present loads, or a step towards it in pseudo-time."""
        model = self.model
        groups, loads, held = model.groups(values), model.loads(values), self._is_held(values)
        symmetric = model.symmetric(values, groups, (loads,), state.x)
        assembly, tolerance = model.assembly(symmetric, held), float(values["solver_tolerance"])
        begun, spent = first and model.members.wing is not None, 0
        for moduli in ((START_MODULUS,), STIFFENED) if begun else ((),):
            start = self._softened_start(assembly, values, loads, state, moduli)
            found = self._equilibrium(assembly, loads, start, tolerance, groups, float(values["pseudo_damping"]))
            spent += found.iterations
            if found.converged:
                break
        else:
            moved = np.linalg.norm(found.x - state.x, axis=1)
            more = "" if model.membranes is None else " and 1e-9 of the loads"
            raise StepFailed(
                f"static equilibrium not found in {spent} Newton iterations ({found.status}): "
                f"{found.residual:.3g} N out of balance, {tolerance:.3g} N{more} asked for; node "
                f"{model.members.labels[int(np.argmax(moved))]} went furthest, by {moved.max():.3g} m."
            )
        shape = Shape(found.x, found.rotations)
        out = model.shown(values, found.x, found.rotations) | {
            "support_force": outward(model.external_force(loads, found.x), model.heading.axes(values)),
            "residual": found.residual,
            "imbalance_before_step": found.residuals[0],
            "unstable_modes": found.unstable_modes,
            "newton_iterations": spent,
            "symmetry_used": float(symmetric),
        }
        out |= model.membrane_reactions(values, groups, loads, found.x, found.rotations)
        if "hold_roll_and_yaw" in values:
            out |= self._holding(values, groups, loads, shape, held)
        return Result(out, shape)

    def _equilibrium(self, assembly, loads, start, tolerance, groups, damping):
        """Balance within `tolerance` N, of membranes within RELATIVE of the external forces too; with `damping` N/m a
        step in pseudo-time.
        """
        if self.model.membranes is None or damping:
            return equilibrium(
                assembly, loads, start.x, tolerance, groups=groups, rotations=start.rotations, damping=damping
            )
        from .membranes import RELATIVE

        found = equilibrium(assembly, loads, start.x, 0.0, RELATIVE, groups=groups, rotations=start.rotations)
        if not found.converged or found.residual <= tolerance:
            return found
        exact = equilibrium(assembly, loads, found.x, tolerance, groups=groups, rotations=found.rotations)
        norms = (*found.residuals, *exact.residuals[1:])
        return replace(exact, iterations=found.iterations + exact.iterations, residuals=norms)

    @staticmethod
    def _is_held(values):
        return bool(values.get("hold_roll_and_yaw", False))

    def _softened_start(self, assembly, values, loads, state, moduli):
        """The shape to start the first solve from: the equilibrium with softened lines, of these moduli Pa in turn.

        In the design shape of a full bridle many lines are far off their rest lengths; stiff ones make Newton crawl
        from kink to kink. Softened to START_MODULUS they let the kite find its attitude, from where the stiff ones are
        near. Only the start depends on it.
        """
        on = loads.on.get("panels")
        force = float(np.linalg.norm(loads.dead)) + (0.0 if on is None else float(np.abs(on.pressure).sum()))
        tolerance, chains = max(1e-3, 1e-6 * force), self.model.chains(values)
        for soft in (self.model.softened(chains, modulus) for modulus in moduli):
            if soft is None:
                break
            groups = self.model.with_chains(values, soft)
            near = equilibrium(assembly, loads, state.x, tolerance, groups=groups, rotations=state.rotations)
            if not near.converged:
                break
            state = Shape(near.x, near.rotations)
        return state

    def _holding(self, values, groups, loads, shape, held):
        """Reactions of the held node: what the free structure is out of balance by."""
        if not held:
            return {"holding_force": 0.0, "holding_moment": np.zeros(3)}
        free, r = self._free_residual(groups, loads, shape)
        about = np.zeros(3) if self.model.pivot is None else self.model.members.nodes[self.model.pivot]
        force, moment = holding_reactions(free, r, shape.x, self.model.held, about)
        return {"holding_force": force, "holding_moment": outward(moment, self.model.heading.axes(values))}

    def _free_residual(self, groups, loads, shape):
        """The assembly without the hold, and what it is out of balance by (q,)."""
        free = self.model.assembly(False)
        prepared = free.prepare(loads, groups)
        return free, free.residual(free.unknowns.restrict(shape.x), prepared, shape.rotations)[0]

    def derivative(self, values, state):
        """Of the displacement along directions in pressure, shear and line load, at the equilibrium of the last step.

        K dX = H^T df and dx = H dX with the consistent tangent K of elements and follower loads
        (`structural.LoadSensitivity`), factorised once.
        """
        model, axes = self.model, self.model.heading.axes(values)
        groups, loads, held = model.groups(values), model.loads(values), self._is_held(values)
        symmetric = bool(values["symmetry_used"])
        reaction = None
        if held:
            free, r = self._free_residual(groups, loads, state)
            reaction = held_moment(free, r, model.held, state.rotations)
        assembly = model.assembly(symmetric, held)
        damping = float(values["pseudo_damping"])
        sensitivity = LoadSensitivity(assembly, loads, state.x, groups, state.rotations, reaction, damping)

        def along(changes):
            changes = {k: v if k == "pressure" else inward(v, axes) for k, v in changes.items()}
            if symmetric:
                panels, lines = model.images
                changes = {k: symmetrised(v, lines if k == "line_load" else panels) for k, v in changes.items()}
            pressure = changes.get("pressure", np.zeros(len(model.interface.panels)))
            on = interface_loads(pressure, changes.get("shear"), changes.get("line_load"))
            moved = sensitivity(Loads(np.zeros_like(state.x), on))
            return {"displacement": outward(model.interface.weights @ moved, axes)}

        return along
