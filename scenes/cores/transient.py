"""The structural solver of a transient scene: loads in, displacements and velocities out, integrated step by step."""

from dataclasses import dataclass, field, replace

import numpy as np

from aero.added_mass import wing_added_mass
from interface import MIRROR, StepFailed
from structural import Loads, equilibrium
from structural.dynamics import SCHEMES, Balance, GeneralisedAlpha, Motion, State, integrate
from structural.elements import Configuration

from ..schema import SceneError
from .core import Result, Solver
from .heading import outward
from .structural_variables import transient_variables
from .structure import StructuralModel

ENERGIES = {
    "kinetic_energy": "kinetic", "elastic_energy": "elastic", "external_work": "work", "reeling_work": "reeled",
    "dissipated_energy": "dissipated", "numerical_loss": "numerical_loss",
}  # fmt: skip
# Part of the loads that may be out of balance at a start in equilibrium, as in the steps after it.
START_RTOL = 1e-9
MOST_SUBSTEPS = 1e6  # of the integration within a communication step: none is meant to take longer


@dataclass(frozen=True, eq=False)
class TransientState:
    """State of all nodes: positions `x` m, velocities `v` m/s and accelerations `a` m/s^2, (n,3) each, what a two-step
    scheme keeps of the step before (`past`: its size s, positions and velocities then), the `loads` at the end of the
    last step, and of each tape its rest length m then and the parameter m that it belonged to, and the rate m/s of its
    reeling; the energy J `exchanged` so far (see `Balance`).
    """

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    past: tuple[float, np.ndarray, np.ndarray] | None = None
    loads: Loads | None = None
    lengths: dict[str, tuple[float, float]] = field(default_factory=dict)
    rates: dict[str, float] = field(default_factory=dict)
    exchanged: float = 0.0


@dataclass(frozen=True, eq=False)
class Window:
    """What happens over one communication step of `dt` s: `loads` go from those at its beginning to those at its end;
    rest `lengths` m of tapes go so too, but for the change m/s of their rates of reeling in the step, which goes
    linearly; `air` (n,3,3) kg is the inertia of the air, None without.
    """

    dt: float
    loads: tuple[Loads, Loads]
    lengths: dict[str, tuple[float, float, float]]
    air: np.ndarray | None

    def share(self, at):
        """Part of the step that has passed at a time s since its beginning."""
        return min(max(at / self.dt, 0.0), 1.0)

    def lengths_at(self, at):
        """Tape -> rest length m."""
        s = self.share(at)
        return {
            name: a + s * (b - a) + 0.5 * s * (s - 1.0) * self.dt * more for name, (a, b, more) in self.lengths.items()
        }

    @property
    def steady(self):
        """Whether no rest length changes."""
        return all(a == b and more == 0.0 for a, b, more in self.lengths.values())

    def rates_at(self, at):
        """Tape -> rate m/s of its rest length at a time s since the beginning."""
        s = self.share(at)
        return {name: (b - a) / self.dt + (s - 0.5) * more for name, (a, b, more) in self.lengths.items()}


class Transient(Solver):
    """Particles of a scene under interface loads, gravity and reeling; a step integrates from t to t + dt s.

    Within a step loads go linearly from those at the end of the step before to the present ones, and so do gravity, the
    parameters of tapes and reels, and the rates of these, whose integral is added to the rest length.
    """

    refuses_derivatives = "a transient structure has no directional derivatives; use a scheme that needs none."

    def __init__(self, scene):
        if scene.members.wing is not None:
            raise SceneError(f"{scene.name}/scene.toml: [dynamics] has no inertia of tubes yet; drop it or the tubes.")
        self.name, self.model = scene.name, StructuralModel(scene)
        self.variables = tuple(transient_variables(scene, self.model))
        self._start = scene.start
        self.criteria = self.model.criteria
        self._scheme = SCHEMES[scene.choices.integration or scene.dynamics.scheme]
        # all masses go with the square of the scale, so what a metre of line weighs goes with the scale of its section
        self._density = scene.structure.line_density / scene.choices.scale
        self._require_masses(scene)

    @staticmethod
    def _require_masses(scene):
        m = scene.members
        bare = np.flatnonzero((m.mass <= 0.0) & ~m.fixed.all(axis=1))
        if len(bare):
            where = f"{scene.name}/{scene.structure.nodes}"
            raise SceneError(
                f"{where}: node '{m.labels[bare[0]]}' has no mass, and in dynamics every free node needs one; give its "
                "lines a density or add it to the masses."
            )

    def begin(self, values):
        """See Solver."""
        x = self._start_positions(values)
        state = TransientState(x, np.zeros_like(x), np.zeros_like(x), lengths=self._lengths(values))
        return Result(self._shown_at_rest(values, state), state)

    def _start_positions(self, values):
        x, _ = self.model.start(values)
        if self._start is None or not bool(values["start_in_equilibrium"]):
            return x
        heading, axes = self.model.heading, self.model.heading.axes(values)
        drawn = heading.placed(x, axes)
        found = self._start.of_nodes(drawn)
        return x if found is drawn else heading.taken_home(found, axes)

    def _lengths(self, values):
        return {name: (float(values[name]), float(values[name])) for name in self.model.tapes}

    def _rates(self, values):
        return {name: float(values[f"{name}_rate"]) for name in self.model.tapes}

    def follow(self, block, values, state, started):
        """See Solver."""
        if block in ("trim_angle", "start_azimuth", "start_in_equilibrium"):
            state = replace(state, x=self._start_positions(values))
        elif started:
            return Result()
        else:  # what is set before the first step is where it begins
            state = replace(state, lengths=self._lengths(values))
        return Result(self._shown(values, state) if started else self._shown_at_rest(values, state), state)

    def must_step(self, values, state, t, dt):
        """See Solver: time goes on."""
        return True

    def step(self, values, state, first, t, dt):
        """Integrate over the communication step."""
        if not 0.0 < dt < np.inf:
            raise StepFailed(f"a step of {dt:g} s is none; time goes forward.")
        if dt > MOST_SUBSTEPS * float(values["longest_step"]):
            raise StepFailed(
                f"a step of {dt:g} s takes more than {MOST_SUBSTEPS:g} steps of the integration, which are of "
                f"{float(values['longest_step']):g} s at most (longest_step); take a shorter one."
            )
        if first:  # what was set before the first step is where it begins
            state = replace(state, lengths=self._lengths(values), rates=self._rates(values))
        vary = state.loads is not None and bool(values["loads_vary"])
        lengths = self._reeled(values, state, t, dt, vary)
        now = self.model.loads(values, self._more_line({name: end for name, (_, end, _) in lengths.items()}))
        air = self._air_mass(values, state.x)
        if first and bool(values["start_in_equilibrium"]):
            state = self._start_in_equilibrium(values, state, now)
        window = Window(dt, (state.loads if vary else now, now), lengths, air)
        motion, symmetric = self._motion(values, state, window)
        begin = self._restricted(motion, state)
        if first or not vary:
            begin = motion.restarted(begin)
        result = integrate(
            motion, begin, dt, self._integrator(values), float(values["longest_step"]),
            atol=float(values["solver_tolerance"]), energy=self._balance(values, motion, begin, first, state.exchanged),
        )  # fmt: skip
        if not result.finished:
            why = result.message[0].lower() + result.message[1:]
            raise StepFailed(f"the motion cannot be integrated beyond {t + result.state.t:.6g} s: {why}")
        assert result.balance is not None  # asked for
        ended = {name: (lengths[name][1], float(values[name])) for name in self.model.tapes}
        state = self._expanded(motion, result.state, now, ended)
        state = replace(state, rates=self._rates(values), exchanged=result.balance.exchanged)
        return Result(self._outputs(values, state, result, air, symmetric), state)

    def _integrator(self, values):
        if self._scheme is GeneralisedAlpha:
            return GeneralisedAlpha(float(values["spectral_radius"]))
        return self._scheme()

    def _reeled(self, values, state, t, dt, vary):
        """Tape -> rest lengths m at the beginning and at the end of the step, and the change m/s of the rate in it,
        which goes from that of the step before to the present one if loads `vary`.
        """
        out, rates = {}, self._rates(values)
        for name, (length, parameter) in state.lengths.items():
            rate = rates[name]
            more = rate - state.rates.get(name, rate) if vary else 0.0
            end = length + float(values[name]) - parameter + dt * (rate - 0.5 * more)
            if end <= 0.0:
                raise StepFailed(
                    f"the rest length of {name} would become {end:.4g} m at {t + dt:.6g} s; reel in slower, or stop "
                    "before it is gone."
                )
            out[name] = length, end, more
        return out

    def _more_line(self, lengths):
        """Change (n,) kg of the masses where tapes and reels have these lengths m; None where they weigh nothing."""
        return self.model.tapes.mass(lengths, self._density) if lengths and self._density else None

    def _motion(self, values, state, window):
        """Equations of motion over the step, and whether one half is solved. Time counts from its beginning, so that
        results do not depend on the rounding of times.
        """
        model, (before, now) = self.model, window.loads
        own = model.mass(values)

        def groups(at):
            return model.with_chains(values, self._damped_chains(values, window, at))

        def loads(at):
            return before.between(now, window.share(at))

        def mass(at):
            more = self._more_line(window.lengths_at(at))
            total = own if more is None else own + more
            return total if window.air is None else total[:, None, None] * np.eye(3) + window.air

        symmetric = model.symmetric(values, groups(0.0), (before, now), state.x) and self._mirrored(state.v)
        steady = window.steady
        given = (mass(0.0), now if before is now else loads, groups(0.0)) if steady else (mass, loads, groups)
        try:
            return Motion(model.assembly(symmetric), *given), symmetric
        except ValueError as error:
            raise StepFailed(str(error)) from None

    def _damped_chains(self, values, window, at):
        """The chains at a time s since the beginning of the step, with dampers and rates of their rest lengths."""
        model = self.model
        line, span = model.members.area > 0.0, (float(values[f"{of}_damping_time"]) for of in ("line", "spring"))
        time = np.where(line, *span)
        rates = None if window.steady else model.tapes.spread(window.rates_at(at))
        groups, first = [], 0
        for group in model.tapes.chains(window.lengths_at(at), self._modulus(values)):
            rows = slice(first, first + len(group))
            first = rows.stop
            damping = time[rows] * group.k if np.any(time > 0.0) else None
            groups.append(replace(group, c=damping, l0_rate=None if rates is None else rates[rows]))
        return tuple(groups)

    @staticmethod
    def _modulus(values):
        """Young's modulus Pa of the lines, None where there are none."""
        return float(values["line_modulus"]) if "line_modulus" in values else None

    def _mirrored(self, v):
        """Whether velocities (n,3) m/s are mirror-symmetric."""
        return np.abs(v - v[self.model.mirror] * MIRROR).max() <= 1e-6 * (1.0 + np.abs(v).max())

    def _air_mass(self, values, x):
        """Inertia (n,3,3) kg of the air that the wing moves, in the shape x (n,3) m; None where there is none."""
        coefficient = float(values.get("added_mass_coefficient", 0.0))
        if coefficient == 0.0:
            return None
        i = self.model.interface
        points = i.weights @ x
        blocks = wing_added_mass(points, i.panels, i.sections, float(values["air_density"]), coefficient)
        shares = abs(i.weights)
        shares = shares.multiply(1.0 / shares.sum(axis=1)[:, None]).tocsr()
        return (shares.T @ blocks.reshape(len(points), 9)).reshape(-1, 3, 3)

    @staticmethod
    def _restricted(motion, state):
        """The state of all nodes as that of the unknowns."""
        r, past = motion.unknowns.restrict, state.past
        past = None if past is None else (past[0], r(past[1]), r(past[2]))
        return State(0.0, r(state.x), r(state.v), r(state.a), past)

    @staticmethod
    def _expanded(motion, end, loads, lengths):
        """The state of all nodes from that of the unknowns."""
        u = motion.unknowns
        past = None if end.past is None else (end.past[0], u.expand(end.past[1]), u.displacements(end.past[2]))
        return TransientState(
            motion.positions(end.q), u.displacements(end.v), u.displacements(end.a), past, loads, lengths
        )

    @staticmethod
    def _balance(values, motion, begin, first, exchanged):
        """The balance of energies so far; the energies themselves are those at the beginning of the step.

        Elements that were set anew since the step before (line_modulus) have put in what they are stiffer; inertia that
        is another (of the air, constant within a step, or wing_mass) counts as made by the scheme.
        """
        sums = {k: float(values[name]) for name, k in ENERGIES.items() if k not in ("kinetic", "elastic")}
        kinetic, elastic = motion.kinetic_energy(begin), motion.elastic_energy(begin)
        if not first:
            stiffer, heavier = elastic - float(values["elastic_energy"]), kinetic - float(values["kinetic_energy"])
            sums["reeled"] += stiffer
            sums["numerical_loss"] -= heavier
            exchanged += abs(stiffer) + abs(heavier)
        return Balance(kinetic, elastic, exchanged=exchanged, **sums)

    def _start_in_equilibrium(self, values, state, loads):
        """The state at rest in equilibrium under the loads."""
        groups = self.model.groups(values)
        symmetric = self.model.symmetric(values, groups, (loads,), state.x)
        tolerance = float(values["solver_tolerance"])
        found = equilibrium(self.model.assembly(symmetric), loads, state.x, tolerance, START_RTOL, groups)
        if not found.converged:
            raise StepFailed(
                f"no equilibrium to start from: {found.residual:.3g} N out of balance after {found.iterations} Newton "
                "iterations; set start_in_equilibrium = 0 to start from the shape of the tables."
            )
        rest = np.zeros_like(found.x)
        return replace(state, x=found.x, v=rest, a=rest, past=None)

    def _shown_at_rest(self, values, state):
        stored = self.model.assembly(False).energy(Configuration(state.x), self.model.groups(values))
        return self._shown(values, state) | {"elastic_energy": stored}

    def _shown(self, values, state):
        lengths = {name: length for name, (length, _) in state.lengths.items()}
        chains = self.model.tapes.chains(lengths, self._modulus(values))  # as reeled, whatever the parameters say
        shown = self.model.shown(values, state.x, None, chains)
        velocity = outward(self.model.interface.weights @ state.v, self.model.heading.axes(values))
        return shown | {"velocity": velocity}

    def _outputs(self, values, state, result, air, symmetric):
        out = self._shown(values, state)
        out |= {name: getattr(result.balance, energy) for name, energy in ENERGIES.items()}
        out |= {f"{name}_present": length for name, (length, _) in state.lengths.items()}
        inertia = self._node_mass(values, state) @ state.a
        if air is not None:
            inertia = inertia + np.einsum("nij,nj->i", air, state.a)
        force = self.model.external_force(state.loads, state.x)
        return out | {
            "support_force": outward(force - inertia, self.model.heading.axes(values)),  # what moves no node is held
            "integration_steps": result.steps,
            "newton_iterations": result.newton_iterations,
            "symmetry_used": float(symmetric),
        }

    def _node_mass(self, values, state):
        more = self._more_line({name: length for name, (length, _) in state.lengths.items()})
        own = self.model.mass(values)
        return own if more is None else own + more
