"""Two participants and one coupling loop: displacement to the flow, loads to the structure, until they agree."""

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from master.acceleration import Scheme
from master.fixed_point import fixed_point
from master.participants import InProcessParticipant, Participant, StepFailed
from master.still_air import StillAir

# Loosest and tightest structural tolerance inside the loop, N, and its share per metre of interface residual: looser
# solves than 1e-4 N turn quasi-Newton columns into noise, and below 1e-8 N rounding of the forces takes over.
LOOSEST, TIGHTEST, PER_METRE = 1e-4, 1e-8, 1e-2


class CoupledStepFailed(ArithmeticError):
    """A participant refused its step; the loop ends as diverged and keeps its history."""


@dataclass
class Coupling:
    """The coupled map G: interface displacement (n,3) m -> displacement of the structure under the loads on that shape.

    One evaluation is one communication step in pseudo-time `dt` s of both participants; they keep their warm starts.
    """

    structural: Participant
    aero: Participant
    dt: float = 1.0
    time: float = 0.0
    evaluations: int = 0
    seconds: dict[str, float] = field(default_factory=lambda: {"structural": 0.0, "aero": 0.0})

    def __post_init__(self) -> None:
        offered = {b for b, c in self.aero.causality.items() if c == "output"}
        wanted = [b for b, c in self.structural.causality.items() if c == "input"]
        missing = [b for b in wanted if b not in offered]
        if missing or "displacement" not in self.aero.blocks or "displacement" not in self.structural.blocks:
            raise ValueError(
                f"the participants do not fit: the structure needs {', '.join(wanted)}, the flow offers "
                f"{', '.join(sorted(offered))}, and both need displacement."
            )
        for block in [*wanted, "displacement"]:
            if self.structural.blocks[block] != self.aero.blocks[block]:
                shapes = f"{self.structural.blocks[block]} in the structure and {self.aero.blocks[block]} in the flow"
                raise ValueError(
                    f"the participants do not fit: {block} has shape {shapes}; "
                    "build both from one scene with one set of settings."
                )
        self._loads = wanted

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Displacement (n,3) m of the structure under the loads on the wing displaced by x (n,3) m."""
        self.evaluations += 1
        with self._timed("aero"):
            self.aero.set("displacement", x)
            self.aero.step(self.time, self.dt)
        with self._timed("structural"):
            for block in self._loads:
                self.structural.set(block, self.aero.get(block))
            self.structural.step(self.time, self.dt)
        self.time += self.dt
        return self.structural.get("displacement")

    @contextlib.contextmanager
    def _timed(self, label: str) -> Iterator[None]:
        """Book the time of a solver's share; a step that it refuses ends the coupled evaluation."""
        start = time.perf_counter()
        try:
            yield
        except StepFailed as error:
            raise CoupledStepFailed(f"the {label} solver refused a step: {str(error).rstrip('.')}") from error
        finally:
            self.seconds[label] += time.perf_counter() - start

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
    again; `history` has a row per coupling iteration; `seconds` total and of each participant.
    """

    displacement: np.ndarray
    status: str
    message: str
    iterations: int
    residual: float
    residual_N: float
    history: list[dict[str, float]]
    seconds: dict[str, float]


def solve(
    coupling: Coupling,
    scheme: Scheme,
    atol: float = 1e-5,
    force_tolerance: float = 0.01,
    max_iterations: int = 200,
    progress: Callable[[int, float], Any] | None = None,
    tie_tolerance: bool = True,
) -> CoupledResult:
    """The coupled equilibrium from the structure's present displacement.

    Converged means ||x_tilde - x||_2 <= `atol` m over all interface entries and an out-of-balance force of at most
    `force_tolerance` N with the flow evaluated again at the reported shape; where the first does not bring the second,
    `atol` is tightened. The structural tolerance follows the residual (`tie_tolerance`), within limits that keep
    quasi-Newton columns clean. `progress(iteration, residual)` is called after every coupling iteration.
    """
    begin = time.perf_counter()
    before = dict(coupling.seconds)
    history: list[dict[str, float]] = []

    def record(k: int, x: np.ndarray, x_tilde: np.ndarray, r: np.ndarray) -> None:
        norm = float(np.linalg.norm(r))
        history.append({"iteration": float(len(history) + 1), "residual_m": norm, **coupling.scalars()})
        if tie_tolerance and np.isfinite(norm):
            coupling.set_tolerance(min(LOOSEST, max(TIGHTEST, PER_METRE * norm)))
        if progress is not None:
            progress(len(history), norm)

    x = coupling.structural.get("displacement")
    residual_N = float("nan")
    if tie_tolerance:
        coupling.set_tolerance(LOOSEST)
    while True:
        left = max_iterations - len(history)
        result = fixed_point(coupling, x, scheme, atol=atol, max_iterations=left, callback=record)
        status, message = result.status, result.message
        if status == "max_iterations":
            message = f"Not converged within {len(history)} coupling iterations."
        if not np.all(np.isfinite(result.x_tilde)):
            residual_N = float("nan")
            break
        if tie_tolerance:
            coupling.set_tolerance(TIGHTEST)
        try:
            residual_N = coupling.imbalance(result.x_tilde)
        except CoupledStepFailed as error:
            status, message, residual_N = "diverged", f"At the converged shape {error}.", float("nan")
        if status != "converged" or residual_N <= force_tolerance:
            break
        if len(history) >= max_iterations:
            status = "max_iterations"
            message = f"residual_N is {residual_N:.3g} N after {len(history)} coupling iterations."
            break
        x, atol = result.x_tilde, atol * min(0.1, 0.5 * force_tolerance / residual_N)
        if atol < np.finfo(float).eps * np.linalg.norm(x):
            status = "stalled"
            message = f"residual_N stays at {residual_N:.3g} N: rounding or the solver_tolerance leaves no smaller one."
            break
    seconds = {k: coupling.seconds[k] - before[k] for k in before}
    seconds["total"] = time.perf_counter() - begin
    x_tilde = result.x_tilde if np.all(np.isfinite(result.x_tilde)) else coupling.structural.get("displacement")
    residual = float(result.residual_norms[-1])
    return CoupledResult(x_tilde, status, message, len(history), residual, residual_N, history, seconds)
