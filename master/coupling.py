"""Structure and flow as one coupled map, and its solution: displacement to the flow, loads to the structure."""

import contextlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from master.acceleration import Scheme
from master.exchange import Connection, CoupledStepFailed, Exchange, Order
from master.fixed_point import fixed_point
from master.participants import InProcessParticipant, Participant
from master.recovery import Progress, Recovery, Warmth
from master.still_air import StillAir

# Loosest and tightest structural tolerance inside the loop, N, and its share per metre of interface residual: looser
# solves than 1e-4 N turn quasi-Newton columns into noise, and below 1e-8 N rounding of the forces takes over.
LOOSEST, TIGHTEST, PER_METRE = 1e-4, 1e-8, 1e-2
# Residual of loads, in parts of the loads, that counts as converged where they are iterated too: with 1e3 N on a kite
# about 1e-3 N, below the force tolerance.
LOADS = 1e-6

__all__ = ["CoupledResult", "CoupledStepFailed", "Coupling", "solve"]


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

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Displacement (n,3) m of the structure under the loads on the wing displaced by x (n,3) m."""
        return self.evaluate(np.ravel(x)).reshape(np.shape(x))

    def described(self, name: str) -> str:
        """See Exchange."""
        return f"the {name} solver"

    @classmethod
    def in_process(cls, scene: Any, parameters: Mapping[str, Any] | None = None) -> "Coupling":
        """The two solver cores of a scene (see `scenes.load`), each with those of the `parameters` that it has; a
        kite that is free to pitch starts from its trim angle unless they give one.

        ValueError in one sentence for a parameter that neither has, for a value that is refused, and where there is no
        trim angle in this wind.
        """
        given = dict(parameters or {})
        cores = scene.cores()
        known = {v.name for core in cores.values() for v in core.variables if v.causality == "parameter"}
        if unknown := sorted(given.keys() - known):
            raise ValueError(f"scene {scene.name} has no parameter {unknown[0]!r}; it has: {', '.join(sorted(known))}.")

        given = scene.with_trim(given)

        def participant(core: Any) -> InProcessParticipant:
            return InProcessParticipant(core, {v.name: given[v.name] for v in core.variables if v.name in given})

        structural = participant(cores["structural"])
        return cls(structural, participant(cores["aero"]) if "aero" in cores else StillAir.beside(structural))

    def fixed(self) -> set[str]:
        """Parameters that take a value only before the first step."""
        limits = (getattr(p, "limits", {}) for p in (self.structural, self.aero))
        return {name for both in limits for name, one in both.items() if one.variability == "fixed"}

    def set_tolerance(self, newtons: float) -> None:
        """Give the structure the tolerance that the coupling loop needs now, where it has one."""
        if "solver_tolerance" in self.structural.blocks:
            self.structural.set("solver_tolerance", newtons)

    def imbalance(self, x: np.ndarray) -> float:
        """Norm N of f_int(x) - f_aero(x) - f_ext with the flow evaluated at x, the present shape of the structure.

        The structure reports it as the residual before its first Newton iteration; its state is put back afterwards.
        """
        state = self.structural.save()
        try:
            self(x)
            return float(self.structural.get("imbalance_before_step"))
        finally:
            self.structural.restore(state)
            self.structural.free(state)

    def scalars(self) -> dict[str, float]:
        """All scalar outputs of both participants."""
        out = {}
        for label, participant in (("structural", self.structural), ("aero", self.aero)):
            for block, shape in participant.blocks.items():
                if shape == () and participant.causality[block] == "output":
                    out[f"{label}.{block}"] = float(participant.get(block))
        return out


@dataclass(frozen=True, eq=False)
class CoupledResult:
    """A coupled solution: how it ended, the history of all evaluations, and the true residual.

    `displacement` (n,3) m is the reported shape, `residual_N` the out-of-balance force there with the flow evaluated
    again; `history` has a row per coupling iteration; `seconds` total and of each participant; `recoveries` what went
    wrong on the way.
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


@dataclass
class Search:
    """Where a coupled solve stands: what it needs, with the states of the participants, to go on.

    `x` (unknowns,) is where the present loop began; `tighter` multiplies the tolerances given; `best` are the states of
    the participants at the best point and their clock, once, after a checkpoint was read.
    """

    order: Order
    x: np.ndarray
    tighter: float = 1.0
    history: list[dict[str, float]] = field(default_factory=list)
    recoveries: list[Recovery] = field(default_factory=list)
    loop: Progress | None = None
    best: tuple[dict[str, Any], tuple[float, int]] | None = None


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
        except (CoupledStepFailed, ValueError, RuntimeError) as error:
            reason = f"At the reported shape {str(error).rstrip('.')}"
    return float("nan"), reason


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
    hold: Callable[[Search, Warmth], object] | None = None,
) -> CoupledResult:
    """The coupled equilibrium from the structure's present displacement.

    Converged means ||x_tilde - x||_2 <= `atol` m over all interface entries and an out-of-balance force of at most
    `force_tolerance` N with the flow evaluated again at the reported shape; where the first does not bring the second,
    `atol` is tightened. In `order` "parallel" both solvers step at once, and loads have to repeat within 1e-6 too.
    The structural tolerance follows the residual (`tie_tolerance`), within limits that keep quasi-Newton columns clean.
    `progress(iteration, residual)` is called after every coupling iteration, `hold(search, warmth)` before it, with
    what a checkpoint needs; `search` from one continues there.

    An evaluation that fails, for whatever reason, puts both solvers back to the best point and is tried again (see
    `fixed_point`).
    """
    begin = time.perf_counter()
    before = dict(coupling.seconds)
    fields = coupling.fields(order)
    shape = tuple(coupling.structural.blocks["displacement"])
    own = fields["structural.displacement"]
    if search is None:
        search = Search(order, coupling.present(order))
        if tie_tolerance:
            coupling.set_tolerance(LOOSEST)
    history = search.history

    def record(k: int, x: np.ndarray, x_tilde: np.ndarray, r: np.ndarray) -> None:
        norm = float(np.linalg.norm(r[own]))
        row = {"iteration": float(len(history) + 1), "residual_m": norm}
        with contextlib.suppress(ValueError, RuntimeError):  # of a solver that has ended
            row |= coupling.scalars()
        if len(history) > 0:  # what the update that led here used
            row |= getattr(scheme, "record", {})
        history.append(row)
        if tie_tolerance and np.isfinite(norm):
            coupling.set_tolerance(min(LOOSEST, max(TIGHTEST, PER_METRE * norm)))
        if progress is not None:
            progress(len(history), norm)

    residual_N = float("nan")
    while True:
        done = len(history) if search.loop is None else len(history) - search.loop.evaluations
        try:
            warmth = Warmth(coupling, search.best)
        except CoupledStepFailed as error:
            raise RuntimeError(f"{error}.") from error
        loop, search.loop, search.best = search.loop, None, None
        now = search  # for the closure

        def held(p: Progress, warmth: Warmth = warmth, now: Search = now) -> None:
            if hold is not None:
                now.loop = p
                hold(now, warmth)

        try:
            result = fixed_point(
                lambda x: coupling.evaluate(x, order),
                search.x,
                scheme,
                atol={name: search.tighter * atol if f == own else 0.0 for name, f in fields.items()},
                rtol={name: 0.0 if f == own else search.tighter * LOADS for name, f in fields.items()},
                max_iterations=max(1, max_iterations - done),  # 0: a restart with fewer than were made
                fields=fields,
                callback=record,
                anchor=warmth,
                hold=held,
                progress=loop,
            )
        finally:
            warmth.close()
        search.loop = None
        search.recoveries += result.recoveries
        shown = result.x_tilde[own].reshape(shape)
        status, message = result.status, result.message
        if status == "max_iterations":
            message = f"Not converged within {len(history)} coupling iterations."
        if not np.all(np.isfinite(shown)):
            residual_N = float("nan")
            break
        if tie_tolerance:
            coupling.set_tolerance(TIGHTEST)
        residual_N, failed = _imbalance(coupling, shown, search)
        if failed and status == "converged":
            status, message = "diverged", f"{failed}."
        if status != "converged" or residual_N <= force_tolerance:
            break
        if len(history) >= max_iterations:
            status = "max_iterations"
            message = f"residual_N is {residual_N:.3g} N after {len(history)} coupling iterations."
            break
        search.x = result.x_tilde
        search.tighter *= min(0.1, 0.5 * force_tolerance / residual_N)
        if search.tighter * atol < np.finfo(float).eps * np.linalg.norm(shown):
            status = "stalled"
            message = f"residual_N stays at {residual_N:.3g} N: rounding or the solver_tolerance leaves no smaller one."
            break
    seconds = {k: coupling.seconds[k] - before[k] for k in before}
    seconds["total"] = time.perf_counter() - begin
    if not np.all(np.isfinite(shown)):
        shown = result.x[own].reshape(shape)
        with contextlib.suppress(ValueError, RuntimeError):
            present = coupling.structural.get("displacement")
            shown = present if np.all(np.isfinite(present)) else shown
    residual = float(result.field_residual_norms["structural.displacement"][-1])
    return CoupledResult(
        shown, status, message, len(history), residual, residual_N, history, seconds, search.recoveries
    )
