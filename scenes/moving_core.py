"""The structure of a scene in motion: loads in, displacements and velocities out, integrated step by step."""

from dataclasses import replace

import numpy as np

from interface import MIRROR, StepFailed
from structural import area_vectors, equilibrium, line_load_forces, surface_forces
from structural.dynamics import SCHEMES, Balance, GeneralisedAlpha, Motion, State, integrate

from .structural_core import StructuralCore
from .symmetry import symmetric_state
from .tables import SceneError

ENERGIES = {
    "kinetic_energy": "kinetic", "elastic_energy": "elastic", "external_work": "work", "reeling_work": "reeled",
    "dissipated_energy": "dissipated", "numerical_loss": "numerical_loss",
}  # fmt: skip


class MovingCore(StructuralCore):
    """Particles of a scene under interface loads, gravity and reeling; `step(t, dt)` integrates from t to t + dt s.

    Within a step loads go linearly from those at the end of the step before to the present ones, and so do gravity and
    the rest lengths of tapes and reels. The state is that of all nodes: positions, velocities, accelerations, and what
    a two-step scheme remembers.
    """

    _hidden: tuple[str, ...] = ("_x", "_v", "_a", "_past", "_before", "_lengths", "_fresh", "_solved", "_rotations")
    _inert: tuple[str, ...] = ()

    def __init__(self, scene):
        if scene.members.wing is not None:
            raise SceneError(f"{scene.name}/scene.toml: [dynamics] has no inertia of tubes yet; drop it or the tubes.")
        n = len(scene.members.nodes)
        self._v, self._a, self._past = np.zeros((n, 3)), np.zeros((n, 3)), None
        self._before = None  # loads at the end of the last step
        self._lengths = None  # tape -> rest length m then, and the parameter that it belonged to
        super().__init__(scene)
        self._lengths = {name: (self._scalar(name), self._scalar(name)) for name in self._tapes}
        scheme = scene.settings.get("integration", scene.content["dynamics"]["scheme"])
        self._scheme = SCHEMES[scheme]
        self._density = scene.content["structure"]["line_density"]
        self._check_masses()

    def _check_masses(self):
        m = self._members
        bare = np.flatnonzero((m.mass <= 0.0) & ~m.fixed.all(axis=1))
        if len(bare):
            where = f"{self._scene.name}/{self._scene.content['structure']['nodes']}"
            raise SceneError(
                f"{where}: node '{m.labels[bare[0]]}' has no mass, and in dynamics every free node needs one; give its "
                "lines a density or add it to the masses."
            )

    def step(self, t: float, dt: float) -> None:
        """Integrate over the communication step; StepFailed, and all as it was, where that cannot be done."""
        if not 0.0 < dt < np.inf:
            raise StepFailed(f"a step of {dt:g} s is none; time goes forward.")
        lengths = self._reeled(t, dt)
        now = self._present_loads(lengths)
        before = now
        if self._before is not None and self._scalar("loads_vary"):
            before = self._before
        started = self._fresh and self._scalar("start_in_equilibrium")
        state = self._settled(now) if started else (self._x, self._v, self._a, self._past)
        air = self._air_mass()
        motion, symmetric = self._motion(state, before, now, lengths, air, dt)
        begin = self._state(motion, state)
        if self._fresh or self._before is None or not self._scalar("loads_vary"):
            begin = motion.again(begin)
        balance = self._balance(motion, begin)
        result = integrate(
            motion, begin, dt, self._integrator(), self._scalar("longest_step"),
            atol=self._scalar("solver_tolerance"), energy=balance,
        )  # fmt: skip
        if not result.finished:
            why = result.message[0].lower() + result.message[1:]
            raise StepFailed(f"the motion cannot be integrated beyond {t + result.state.t:.6g} s: {why}")
        self._unsolved()
        with self._finite_results():
            self._fresh = False
            end = result.state
            u = motion.unknowns
            self._x, self._v, self._a = motion.positions(end.q), u.moves(end.v), u.moves(end.a)
            self._past = None if end.past is None else (end.past[0], u.expand(end.past[1]), u.moves(end.past[2]))
            self._before = now
            self._lengths = {name: (lengths[name][1], self._scalar(name)) for name in self._tapes}
            self._show_motion(result, now, air, symmetric)
        self._stale, self._solved = False, False

    def _integrator(self):
        if self._scheme is GeneralisedAlpha:
            return GeneralisedAlpha(self._scalar("spectral_radius"))
        return self._scheme()

    def _reeled(self, t, dt):
        """Tape -> rest lengths m at the beginning and at the end of the step."""
        out = {}
        for name, (length, parameter) in self._lengths.items():
            if self._fresh:  # what was set before the first step is where it begins
                length = parameter = self._scalar(name)
            end = length + self._scalar(name) - parameter + dt * self._scalar(f"{name}_rate")
            if end <= 0.0:
                raise StepFailed(
                    f"the rest length of {name} would become {end:.4g} m at {t + dt:.6g} s; reel in slower, or stop "
                    "before it is gone."
                )
            out[name] = length, end
        return out

    def _present_loads(self, lengths=None):
        """The loads at the end of the step, with the weight of the line that is out then."""
        loads = super()._present_loads()
        if not lengths or not self._density:
            return loads
        change = self._tapes.mass({name: end for name, (_, end) in lengths.items()}, self._density)
        dead = loads.dead.copy()
        dead[:, 2] -= change * self._scalar("gravity")
        return replace(loads, dead=dead)

    def _motion(self, state, before, now, lengths, air, dt):
        """Equations of motion over the step, and whether one half is solved. Time counts from its beginning, so that
        results do not depend on the rounding of times.
        """
        steady = all(a == b for a, b in lengths.values())
        modulus = self._scalar("line_modulus") if "line_modulus" in self._values else None
        line = self._members.area > 0.0
        time = np.where(line, *(self._scalar(f"{of}_damping_time") for of in ("line", "spring")))
        damped = bool(np.any(time > 0.0))
        wing_mass = self._scalar("wing_mass") if "wing_mass" in self._values else 0.0

        def part(at):
            return min(max(at / dt, 0.0), 1.0)

        def at_lengths(at):
            s = part(at)
            return {name: a + s * (b - a) for name, (a, b) in lengths.items()}

        def chains(at):
            rates = None if steady else self._tapes.spread({n: (b - a) / dt for n, (a, b) in lengths.items()})
            groups, first = [], 0
            for group in self._tapes.chains(at_lengths(at), modulus):
                rows = slice(first, first + len(group.l0))
                first = rows.stop
                damping = time[rows] * group.k if damped else None
                groups.append(replace(group, c=damping, l0_rate=None if rates is None else rates[rows]))
            return tuple(groups)

        def groups(at):
            return self._groups(chains(at))

        def loads(at):
            s = part(at)
            return before.between(now, s)

        def mass(at):
            own = self._members.mass_with(wing_mass)
            own = own if not self._tapes_weigh else own + self._tapes.mass(at_lengths(at), self._density)
            return own if air is None else own[:, None, None] * np.eye(3) + air

        symmetric = bool(self._values["symmetric"]) and self._mirrored(chains(0.0), before, now, state)
        given = (mass, loads, groups) if not steady else (mass(0.0), now if before is now else loads, groups(0.0))
        try:
            return Motion(self._assembly(symmetric, False), *given), symmetric
        except ValueError as error:
            raise StepFailed(str(error)) from None

    def _air_mass(self):
        """Inertia (n,3,3) kg of the air that the wing moves along its normals, in the shape at the beginning of the
        step; None where there is none.
        """
        coefficient = self._scalar("added_mass_coefficient") if "added_mass_coefficient" in self._values else 0.0
        if coefficient == 0.0:
            return None
        i = self._interface
        points = i.weights @ self._x
        a = area_vectors(points[i.panels])
        area = np.linalg.norm(a, axis=1)
        chord = np.linalg.norm(points[i.sections[:, -1]] - points[i.sections[:, 0]], axis=1)
        strip = np.tile(0.5 * (chord[:-1] + chord[1:]), len(i.fractions) - 1)
        of_panel = (0.25 * np.pi * coefficient * self._scalar("air_density") * strip / area)[:, None, None]
        of_panel = 0.25 * of_panel * (a[:, :, None] * a[:, None, :])  # m n n^T of the panel, a quarter to each corner
        blocks = np.zeros((len(points), 3, 3))
        for corner in i.panels.T:
            np.add.at(blocks, corner, of_panel)
        shares = abs(i.weights)
        shares = shares.multiply(1.0 / shares.sum(axis=1)[:, None]).tocsr()
        return (shares.T @ blocks.reshape(len(points), 9)).reshape(-1, 3, 3)

    @property
    def _tapes_weigh(self):
        return bool(self._density) and any(True for _ in self._tapes)

    def _mirrored(self, chains, before, now, state):
        from .checks import symmetric_chains

        x, v, _, _ = state
        return (
            self._mirrored_supports
            and symmetric_chains(chains, self._mirror)
            and all(symmetric_state(loads, x, self._mirror, self._images) for loads in (before, now))
            and np.abs(v - v[self._mirror] * MIRROR).max() <= 1e-6 * (1.0 + np.abs(v).max())
        )

    def _state(self, motion, state):
        """The state of all nodes as that of the unknowns."""
        x, v, a, past = state
        r = motion.unknowns.restrict
        return State(0.0, r(x), r(v), r(a), None if past is None else (past[0], r(past[1]), r(past[2])))

    def _balance(self, motion, begin):
        """The balance of energies so far; the energies themselves are those at the beginning of the step."""
        sums = {k: self._scalar(name) for name, k in ENERGIES.items() if k not in ("kinetic", "elastic")}
        return Balance(motion.kinetic_energy(begin), motion.elastic_energy(begin), **sums)

    def _settled(self, loads):
        """The state at rest in equilibrium under the loads."""
        chains, mirrored = self._present_chains()
        symmetric = bool(self._values["symmetric"]) and mirrored
        symmetric = symmetric and symmetric_state(loads, self._x, self._mirror, self._images)
        found = equilibrium(self._assembly(symmetric, False), loads, self._x, 1e-4, groups=self._groups(chains))
        if not found.converged:
            raise StepFailed(
                f"no equilibrium to start from: {found.residual:.3g} N out of balance after {found.iterations} Newton "
                "iterations; set start_in_equilibrium = 0 to start from the shape of the tables."
            )
        return found.x, np.zeros_like(found.x), np.zeros_like(found.x), None

    def directional_derivative(self, changes):
        """Refused: a structure in motion has no equilibrium to differentiate."""
        raise ValueError("a structure in motion has no directional derivatives; use a scheme that needs none.")

    def _show_shape(self):
        super()._show_shape()
        self._put("velocity", self._interface.weights @ self._v)

    def _show_motion(self, result, loads, air, symmetric):
        self._show_shape()
        for name, energy in ENERGIES.items():
            self._put(name, getattr(result.balance, energy))
        for name, (length, _) in self._lengths.items():
            self._put(f"{name}_present", length)
        surface = self._interface.weights @ self._x
        panels, lines = loads.on.get("panels"), loads.on.get("lines")
        force = loads.dead.sum(axis=0)
        if panels is not None:
            force = (
                surface_forces(surface[self._interface.panels], panels.pressure, panels.shear).sum(axis=(0, 1)) + force
            )
        if lines is not None:
            force = force + line_load_forces(surface[self._interface.lines], lines.per_length).sum(axis=(0, 1))
        inertia = self._node_mass() @ self._a
        if air is not None:
            inertia = inertia + np.einsum("nij,nj->i", air, self._a)
        self._put("support_force", force - inertia)  # what moves no node is held
        self._put("integration_steps", result.steps)
        self._put("newton_iterations", result.newton_iterations)
        self._put("symmetry_used", float(symmetric))

    def _node_mass(self):
        own = self._members.mass_with(self._scalar("wing_mass") if "wing_mass" in self._values else 0.0)
        if not self._tapes_weigh:
            return own
        return own + self._tapes.mass({name: length for name, (length, _) in self._lengths.items()}, self._density)
