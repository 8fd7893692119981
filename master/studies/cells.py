"""One cell of a comparison: the scene loaded anew, solved with a new scheme object, and what is worth knowing of it."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from master.commands import at_rest, opened, pair, prepared
from master.coupling.equilibrium import CoupledResult, Coupling, solve
from master.coupling.participants import Participant
from master.coupling.participants.private_folder import PrivateFolder
from master.coupling.schemes import SCHEMES, scheme
from master.coupling.simulation import Simulation, simulate
from master.studies.couplings import BACKEND, coupled_row
from master.studies.grid import Cell

OUTPUTS = ("CL", "CD", "tip_span")  # outputs of the flow that tell one equilibrium from another
HISTORIES = {
    "residual_history_m": "residual_m",
    "residual_history_N": "structural.imbalance_before_step",
    "newton_history_structural": "structural.newton_iterations",
    "newton_history_aero": "aero.newton_iterations",
}
STEPS = "evaluations_history"  # evaluations of each communication step of a transient scene
RECORDS = ("omega", "columns", "filtered", "products")  # what a scheme may say of an update
_WARM: set[str] = set()  # folders of scenes that this process has solved


class Counted:
    """A participant that counts its steps and those that it refused."""

    def __init__(self, participant: Participant) -> None:
        self._participant = participant
        self.calls = self.failures = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._participant, name)

    def step(self, t: float, dt: float) -> None:
        """See Participant."""
        self.calls += 1
        try:
            self._participant.step(t, dt)
        except Exception:
            self.failures += 1
            raise


def solved(cell: Cell) -> dict[str, Any]:
    """The row of a cell: status, counts, seconds, residuals, histories, outputs, displacement (3n,) m, all settings.

    Wall times are those of the solve with the median total of `repeat`. Whatever goes wrong beyond what a solver
    reports makes a row of the status "crashed".
    """
    begin = time.perf_counter()
    try:
        if cell.backend == BACKEND:
            return coupled_row(cell)
        scene, given, cores = prepared(cell.folder, cell.assigned)
        scene, _, _ = at_rest(scene, given, cores)
        _warm(cell, scene, given)
        with PrivateFolder() as folder:
            solves = [_solve(cell, scene, given, folder) for _ in range(cell.repeat)]
        seconds = sorted((s for _, s in solves), key=lambda s: s.get("total", 0.0))[(cell.repeat - 1) // 2]
        row = solves[0][0]
    except Exception as error:
        # a defect of one cell must not end the others
        return crashed(f"{type(error).__name__}: {error}")
    row["seconds"] = seconds | {"cell": time.perf_counter() - begin}
    return row


def _warm(cell: Cell, scene: Any, given: dict[str, Any]) -> None:
    """Two coupling iterations of a scene that this process has not met: what loads at first use is no scheme's time."""
    if cell.folder not in _WARM:
        _WARM.add(cell.folder)
        if cell.step is not None:
            with opened(scene, "in-process", given, Path()) as sides:
                simulate(sides, 2.0 * cell.step, cell.step)
            return
        solve(Coupling.in_process(scene, given), scheme("relaxation"), max_iterations=2)


def crashed(reason: str) -> dict[str, Any]:
    """The row of a cell that gave no result, for a reason."""
    return {"status": "crashed", "message": " ".join(reason.split())}


def _solve(cell: Cell, scene: Any, given: dict[str, Any], folder: Path) -> tuple[dict[str, Any], dict[str, float]]:
    """What one solve found and, apart, what it took."""
    if cell.step is not None:
        return _simulate(cell, scene, given, folder)
    with pair(scene, cell.backend, given, folder) as coupling:
        coupling.structural, coupling.aero = Counted(coupling.structural), Counted(coupling.aero)
        coupling.participants = {"aero": coupling.aero, "structural": coupling.structural}
        if SCHEMES[cell.scheme].exact:
            try:
                coupling.require_derivatives()
            except ValueError as error:
                return {"status": "unavailable", "message": str(error)}, {}
        order: Any = cell.order
        result = solve(
            coupling,
            scheme(cell.scheme, coupling, order, **cell.parameters),
            atol=cell.tolerance,
            force_tolerance=cell.force_tolerance,
            max_iterations=cell.max_iterations,
            order=order,
            tie_tolerance="solver_tolerance" not in given,
        )
        found = _row(coupling, result)
    found["settings"] = {"scene": dict(scene.settings), **found["settings"]}
    seconds = result.seconds
    master = seconds["total"] - seconds["structural"] - seconds["aero"]
    return found, {**{k: seconds[k] for k in ("total", "structural", "aero")}, "master": master}


def _simulate(cell: Cell, scene: Any, given: dict[str, Any], folder: Path) -> tuple[dict[str, Any], dict[str, float]]:
    """What one transient run found and, apart, what it took."""
    if SCHEMES[cell.scheme].exact:
        return {"status": "unavailable", "message": f"{cell.scheme} takes derivatives of quasi-static solves."}, {}
    assert cell.stop_time is not None
    assert cell.step is not None
    order: Any = cell.order
    with opened(scene, cell.backend, given, folder) as sides:
        counted: dict[str, Any] = {side: Counted(participant) for side, participant in sides.items()}
        begin = time.perf_counter()
        run = simulate(
            counted, cell.stop_time, cell.step, cell.scheme, order, cell.tolerance, cell.max_iterations,
            **cell.parameters,
        )  # fmt: skip
        total = time.perf_counter() - begin
        found = _moved(run, counted)
    found["settings"] = {"scene": dict(scene.settings), **found["settings"]}
    apart = {side: float(run.seconds.get(side, 0.0)) for side in ("structural", "aero")}
    return found, {"total": total, **apart, "master": total - sum(apart.values())}


def _moved(run: Simulation, sides: dict[str, Any]) -> dict[str, Any]:
    status, message, structure = run.status, run.message, sides["structural"]
    if run.finished:
        status, message = "converged", f"All {len(run.steps)} communication steps converged."
    return {
        "status": status,
        "message": message,
        "coupling_iterations": run.evaluations,
        "communication_steps": len(run.steps),
        "recoveries": sum(run.steps.recoveries),
        "histories": {STEPS: list(run.steps.iterations)},
        "displacement": np.ravel(structure.get("displacement")).tolist() if "displacement" in structure.blocks else [],
        "outside_validity": sum(not j.within for j in run.validity),
        **_of_sides(sides),
    }


def _row(coupling: Coupling, result: CoupledResult) -> dict[str, Any]:
    history = result.history
    row: dict[str, Any] = {
        "status": result.status,
        "message": result.message,
        "coupling_iterations": result.iterations,
        "residual_m": result.residual,
        "residual_N": result.residual_N,
        "recoveries": len(result.recoveries),
        "histories": {name: [row.get(column) for row in history] for name, column in HISTORIES.items()},
        "displacement": np.ravel(result.displacement).tolist(),
        "outside_validity": sum(not j.within for j in coupling.validity()),
    }
    for name in RECORDS:
        row["histories"][f"{name}_history"] = [h.get(name) for h in history]  # of the update that led there
    return row | _of_sides({"structural": coupling.structural, "aero": coupling.aero})


def _of_sides(sides: dict[str, Any]) -> dict[str, Any]:
    """What is known of the participants: calls, failures, outputs of the flow, parameters."""
    aero = sides.get("aero")
    return {
        "calls": {side: participant.calls for side, participant in sides.items()},
        "failures": sum(participant.failures for participant in sides.values()),
        "outputs": {} if aero is None else {name: float(aero.get(name)) for name in OUTPUTS if name in aero.blocks},
        "settings": {
            side: {b: participant.get(b).tolist() for b, c in participant.causality.items() if c == "parameter"}
            for side, participant in sides.items()
        },
    }
