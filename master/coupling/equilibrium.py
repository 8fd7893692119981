"""Structure and flow as one coupled map, and its solution: displacement to the flow, loads to the structure."""

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from interface import StepFailed
from master.coupling import pseudo_time
from master.coupling.acceleration import ConstantRelaxation, Scheme
from master.coupling.convergence import Tolerance, required_count, required_number
from master.coupling.exchange import Connection, CoupledStepFailed, Exchange, Order, StateSnapshot
from master.coupling.fixed_point import FixedPointResult
from master.coupling.participants import InProcessParticipant, Participant
from master.coupling.participants.zero_loads import ZeroLoads
from master.coupling.recovery import Recovery
from master.coupling.steady import Goal, Search, Verdict, steady
from master.coupling.validity import Judgement, judgements

# Loosest and tightest structural tolerance inside the loop, N, and its share per metre of interface residual: looser
# solves than 1e-4 N turn quasi-Newton columns into noise, and below 1e-8 N rounding of the forces takes over.
LOOSEST, TIGHTEST, PER_METRE = 1e-4, 1e-8, 1e-2
# Residual of loads, in parts of the loads, that counts as converged where they are iterated too: with 1e3 N on a kite
# about 1e-3 N, below the force tolerance.
LOADS = 1e-6

__all__ = ["CoupledResult", "CoupledStepFailed", "Coupling", "Equilibrium", "Search", "solve"]


# First updates of quasi-Newton schemes on wings that their first loads inflate. Parafoils take 18 to 22 iterations with
# the first factor of other kites, 11 to 29 with 1, 10 to 15 with two such updates.
INFLATING = {"omega0": 1.0, "relaxed": 2}


class Coupling(Exchange):
    """Flow and structure, exchanging all loads and the displacement. Called, it is the coupled map G: interface
    displacement (n,3) m -> displacement of the structure under the loads on that shape.

    One evaluation is one communication step in pseudo-time `dt` s of both participants; they keep their warm starts.
    """

    def __init__(self, structural: Participant, aero: Participant, dt: float = 1.0, time: float = 0.0) -> None:
        self.structural, self.aero = structural, aero
        offered = {b for b, c in aero.causality.items() if c == "output"}
        wanted = [b for b, c in structural.causality.items() if c == "input"]
        missing = [b for b in wanted if b not in offered]
        if missing or "displacement" not in aero.blocks or "displacement" not in structural.blocks:
            raise ValueError(
                f"the participants do not fit: the structure needs {', '.join(wanted)}, the flow offers "
                f"{', '.join(sorted(offered))}, and both need displacement."
            )
        for block in [*wanted, "displacement"]:
            if structural.blocks[block] != aero.blocks[block]:
                shapes = f"{structural.blocks[block]} in the structure and {aero.blocks[block]} in the flow"
                raise ValueError(
                    f"the participants do not fit: {block} has shape {shapes}; "
                    "build both from one scene with one set of settings."
                )
        connections = [Connection("aero", block, "structural", block) for block in wanted]
        connections.append(Connection("structural", "displacement", "aero", "displacement"))
        super().__init__({"aero": aero, "structural": structural}, connections, dt, time)
        self.first_updates: dict[str, float] = {}  # parameters of quasi-Newton schemes, where their own do not suit
        self.start = structural.get("displacement")  # (n,3) m, of the shape that its parameters let it start in

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Displacement (n,3) m of the structure under the loads on the wing displaced by x (n,3) m."""
        return self.evaluate(np.ravel(x)).reshape(np.shape(x))

    def described(self, name: str) -> str:
        """See Exchange."""
        return f"the {name} solver"

    @classmethod
    def in_process(
        cls, scene: Any, parameters: Mapping[str, Any] | None = None, cores: Mapping[str, Any] | None = None
    ) -> "Coupling":
        """The two solver cores of a scene (see `scenes.load`), new ones or the given ones, each with those of the
        `parameters` that it has; a kite that is free to pitch starts from its trim angle unless they give one.

        ValueError in one sentence for a parameter that neither has, for a value that is refused, where there is no trim
        angle in this wind, and for a scene without a structure.
        """
        require_structure(scene)
        given = dict(parameters or {})
        cores = scene.cores() if cores is None else cores
        known = {v.name for core in cores.values() for v in core.variables if v.causality == "parameter"}
        if unknown := sorted(given.keys() - known):
            raise ValueError(f"scene {scene.name} has no parameter {unknown[0]!r}; it has: {', '.join(sorted(known))}.")

        given = scene.with_trim(given, cores)

        def participant(core: Any) -> InProcessParticipant:
            return InProcessParticipant(core, {v.name: given[v.name] for v in core.variables if v.name in given})

        structural = participant(cores["structural"])
        coupled = cls(structural, participant(cores["aero"]) if "aero" in cores else ZeroLoads.beside(structural))
        return coupled.of_scene(scene)

    def of_scene(self, scene: Any) -> "Coupling":
        """The coupling itself, which starts as suits the participants of a `scene`: a wing that its first loads inflate
        goes the whole way twice, and schemes learn from then on: what flat cells do says nothing of inflated ones.
        """
        self.first_updates = INFLATING if scene.inflates else {}
        return self

    def set_tolerance(self, newtons: float) -> None:
        """Give the structure the tolerance that the coupling loop needs now, where it has one."""
        if "solver_tolerance" in self.structural.blocks:
            self.structural.set("solver_tolerance", newtons)

    def imbalance(self, x: np.ndarray) -> float:
        """Norm N of f_int(x) - f_aero(x) - f_ext with the flow evaluated at x, the present shape of the structure.

        The structure reports it as the residual before its first Newton iteration; its state is restored afterwards.
        """
        state = self.structural.save()
        try:
            self(x)
            return float(self.structural.get("imbalance_before_step"))
        finally:
            self.structural.restore(state)
            self.structural.free(state)

    def validity(self) -> list[Judgement]:
        """The present state judged by what each solver says of itself: up to where its models are known to be good."""
        return judgements({"structural": self.structural, "aero": self.aero})

    def scalars(self) -> dict[str, float]:
        """All scalar outputs of both participants."""
        out = {}
        for label, participant in (("structural", self.structural), ("aero", self.aero)):
            for block, shape in participant.blocks.items():
                if shape == () and participant.causality[block] == "output":
                    out[f"{label}.{block}"] = float(participant.get(block))
        return out


def require_structure(scene: Any) -> None:
    """ValueError in one sentence for a scene of a rigid wing."""
    if not scene.has_structure:
        raise ValueError(
            f"scene '{scene.name}' is a rigid wing without a structure, so that there is nothing to couple; solve its "
            "flow with `kitecosim run` or `kitecosim polar`."
        )


@dataclass(frozen=True, eq=False)
class CoupledResult:
    """A coupled solution: how it ended, the history of all evaluations, and the true residual.

    `displacement` (n,3) m is the reported shape, `residual_N` the out-of-balance force there with the flow evaluated
    again; `history` has a row per coupling iteration; `seconds` total and of each participant; `recoveries` what went
    wrong on the way; `iterate` the coupling iteration in which the structure had this shape, 0 for that of the start.
    """

    displacement: np.ndarray
    status: str
    message: str
    iterations: int
    residual: float
    residual_N: float
    history: list[dict[str, float]]
    seconds: dict[str, float]
    recoveries: list[Recovery] = field(default_factory=list)
    iterate: int | None = None


class Equilibrium(Goal):
    """A coupled equilibrium: displacements that repeat within `atol` m, in `order` "parallel" loads within LOADS too,
    and an out-of-balance force of at most `force_tolerance` N with the flow evaluated again.

    The structural tolerance follows the residual (`tie_tolerance`), within limits that keep quasi-Newton columns clean.
    `progress(iteration, residual)` is called after every evaluation. A loop that has stalled because the structure
    jumps from one equilibrium to another goes on in pseudo-time, once, where it `may_hold_back` nodes.
    """

    def __init__(
        self,
        coupling: Coupling,
        order: Order,
        atol: float,
        force_tolerance: float,
        tie_tolerance: bool = True,
        progress: Callable[[int, float], Any] | None = None,
        may_hold_back: bool = True,
    ) -> None:
        self._coupling, self._atol, self._force_tolerance = coupling, atol, force_tolerance
        self._may_hold_back = may_hold_back and pseudo_time.BLOCK in coupling.structural.blocks
        self._tie, self._progress = tie_tolerance, progress
        self._fields = coupling.fields(order)
        self.own = self._fields["structural.displacement"]
        self.shape = tuple(coupling.structural.blocks["displacement"])
        self._iterates = {hash(np.ravel(coupling.start).tobytes()): 0}

    def begin(self) -> None:
        """See Goal."""
        if self._tie:
            self._coupling.set_tolerance(LOOSEST)
        if self._may_hold_back and float(self._coupling.structural.get(pseudo_time.BLOCK)) > 0.0:  # of an earlier run
            self._coupling.structural.set(pseudo_time.BLOCK, np.array(0.0))

    def iterate(self, displacement: np.ndarray) -> int | None:
        """The last coupling iteration after which the structure was displaced so (n,3) m; 0: at the start, None: in no
        one of this run.
        """
        return self._iterates.get(hash(np.ravel(displacement).tobytes()))

    def tolerances(self, tighter: float) -> tuple[Tolerance, Tolerance, Tolerance]:
        """See Goal: metres for the displacement, parts of their size for loads."""
        atol = {name: tighter * self._atol if f == self.own else 0.0 for name, f in self._fields.items()}
        rtol = {name: 0.0 if f == self.own else tighter * LOADS for name, f in self._fields.items()}
        return atol, rtol, 0.0

    def observed(self, x: np.ndarray, x_tilde: np.ndarray, r: np.ndarray, search: Search) -> dict[str, float]:
        """See Goal: the residual of the displacement, m, and all scalar outputs."""
        norm = float(np.linalg.norm(r[self.own]))
        self._iterates[hash(np.ravel(x_tilde)[self.own].tobytes())] = len(search.history) + 1
        row = {"residual_m": norm}
        with contextlib.suppress(ValueError, RuntimeError):  # of a solver that has ended
            row |= self._coupling.scalars()
        if self._tie and np.isfinite(norm):
            self._coupling.set_tolerance(min(LOOSEST, max(TIGHTEST, PER_METRE * norm)))
        if self._progress is not None:
            self._progress(len(search.history) + 1, norm)
        return row

    def verdict(self, found: FixedPointResult, search: Search, max_iterations: int) -> Verdict:
        """See Goal: the residual is the out-of-balance force N."""
        shown = found.x_tilde[self.own].reshape(self.shape)
        count, status, message = len(search.history), str(found.status), found.message
        if status == "max_iterations":
            message = f"Not converged within {count} coupling iterations."
        if not np.all(np.isfinite(shown)):
            return Verdict(status, message)
        if self._tie:
            self._coupling.set_tolerance(TIGHTEST)
        force, failed = _imbalance(self._coupling, shown, search)
        if failed and status == "converged":
            status, message = "diverged", f"{failed}."
        length = float(np.linalg.norm((found.x_tilde - found.x)[self.own]))
        if status == "stalled" and self._may_hold_back and force / length > 0.0 and pseudo_time.jumping(search.history):
            self._may_hold_back = False
            reason, remedy = "the structure jumped from one equilibrium to another", "led on in pseudo-time"
            search.recoveries.append(Recovery(count, reason, remedy))
            return Verdict(
                status, message, force, 1.0, pseudo_time.PseudoTime(self._coupling.structural, force / length)
            )
        if status != "converged" or force <= self._force_tolerance:
            return Verdict(status, message, force)
        if count >= max_iterations:
            message = f"residual_N is {force:.3g} N after {count} coupling iterations."
            return Verdict("max_iterations", message, force)
        tighter = min(0.1, 0.5 * self._force_tolerance / force)
        if search.tighter * tighter * self._atol < np.finfo(float).eps * np.linalg.norm(shown):
            message = f"residual_N stays at {force:.3g} N: rounding or the solver_tolerance leaves no smaller one."
            return Verdict("stalled", message, force)
        return Verdict(status, message, force, tighter)


def _imbalance(coupling: Coupling, shown: np.ndarray, search: Search) -> tuple[float, str]:
    """Out-of-balance force N at the shape, tried twice; nan and why if there is none."""
    reason = ""
    for _ in range(2):
        if reason:
            search.recoveries.append(Recovery(len(search.history), reason, "tried again"))
        try:
            force = coupling.imbalance(shown)
            if np.isfinite(force):
                return force, ""
            reason = "At the reported shape the out-of-balance force is not a finite number"
        except (StepFailed, ValueError, RuntimeError) as error:
            reason = f"At the reported shape {str(error).rstrip('.')}"
    return float("nan"), reason


def _show(coupling: Coupling, shown: np.ndarray) -> None:
    """Let the flow see a shape, where it has another, and give the loads on it if it can: what is written is of one."""
    with contextlib.suppress(
        Exception
    ):  # whatever a solver raises that has failed before: the shape is shown all the same
        if not np.array_equal(coupling.aero.get("displacement"), shown):
            coupling.aero.set("displacement", shown)
            coupling.aero.step(coupling.time, coupling.dt)


def solve(
    coupling: Coupling,
    scheme: Scheme,
    atol: float = 1e-5,
    force_tolerance: float = 0.01,
    max_iterations: int = 200,
    progress: Callable[[int, float], Any] | None = None,
    tie_tolerance: bool = True,
    order: Order = "serial",
    search: Search | None = None,
    hold: Callable[[Search, StateSnapshot], object] | None = None,
) -> CoupledResult:
    """The coupled equilibrium from the structure's present displacement.

    Converged means ||x_tilde - x||_2 <= `atol` m over all interface entries and an out-of-balance force of at most
    `force_tolerance` N with the flow evaluated again at the reported shape; where the first does not bring the second,
    `atol` is tightened. In `order` "parallel" both solvers step at once, and loads have to repeat within 1e-6 too.
    `tie_tolerance` and `progress` see `Equilibrium`, `search` and `hold` see `master.coupling.steady.steady`.

    ValueError in one sentence for tolerances, iterations or an order that make no sense. An evaluation that fails, for
    whatever reason, puts both solvers back to the best point and is tried again (see
    `fixed_point`). Where a loop stalls because the structure jumps between equilibria, schemes other than constant
    relaxation go on in pseudo-time (see `pseudo_time`); the structure has its damping at the end.
    """
    required_number("atol", atol)
    required_number("force_tolerance", force_tolerance, infinite=True)
    required_count("max_iterations", max_iterations)
    fixed = isinstance(scheme, ConstantRelaxation)
    goal = Equilibrium(coupling, order, atol, force_tolerance, tie_tolerance, progress, not fixed)
    try:
        run = steady(coupling, scheme, goal, order, max_iterations, search=search, hold=hold)
    except StepFailed as error:  # of a solver that cannot save its state
        raise RuntimeError(f"{error}.") from error
    found = run.found
    shown = found.x_tilde[goal.own].reshape(goal.shape)
    if run.status != "converged":
        shown = shown if np.all(np.isfinite(shown)) else found.x[goal.own].reshape(goal.shape)
        with contextlib.suppress(ValueError, RuntimeError):  # of a solver that has ended
            present = coupling.structural.get("displacement")  # after a recovery not that of the last evaluation
            shown = present if np.all(np.isfinite(present)) else shown
        _show(coupling, shown)
    residual = float(found.field_residual_norms["structural.displacement"][-1])
    history = run.history
    return CoupledResult(
        shown,
        run.status,
        run.message,
        len(history),
        residual,
        run.residual,
        history,
        run.seconds,
        run.recoveries,
        goal.iterate(shown),
    )
