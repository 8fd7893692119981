"""Reference inputs and results that an FMU carries, to see in a tool of one's own that it computes what it should."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmus.description import scalar_names
from interface import StepFailed, Variable
from scenes import Scene

STEPS = 5  # communication steps: of 1 s, or the usual one of a transient scene
PITCH = 0.01  # rad, by which a wing without a structure is turned from step to step
# To compare with on another machine. Rounding and the solvers' tolerances move results by some 1e-11 of a variable.
RELATIVE = ABSOLUTE = 1e-6
SOLVERS = ("residual", "newton_iterations")  # how a solver got there, no result: other on every machine
LOADS = ("pressure", "shear", "line_load")  # what a flow gives a structure, as far as a scene has it
MOTION = ("displacement", "velocity")  # what a structure gives a flow, likewise
INTERFACE = (*MOTION, *LOADS)


def reference_tables(
    scene: Scene, parameters: Mapping[str, Any], cores: Mapping[str, Any] | None = None
) -> dict[str, tuple[str, str]]:
    """Side -> inputs and results of its FMU as CSV texts, from a coupled exchange of the two solvers.

    A row of inputs holds from its time on, for a communication step; a row of results holds at its time, the first
    after initialization mode; it has the interface, and all outputs but long ones and those of `SOLVERS`. The flow goes
    first, as in the explicit scheme. Without a flow the panels, if any, are pressed by 1, 2, 3 Pa and so on; without a
    structure the wing is turned nose-up by 0, 0.01, 0.02 rad and so on. Where a solver cannot complete a step the
    tables end before it. Numbers are exact: the shortest that are read back to the
    same bits. `cores` of the scene, where there are some, take the parameters and are as they were otherwise.
    """
    cores = dict(cores or scene.cores())
    for core in cores.values():
        for variable in core.variables:
            if variable.name in parameters and variable.causality == "parameter":
                core.set(variable.name, np.array(parameters[variable.name], dtype=float))
    before = {side: core.save() for side, core in cores.items()}
    try:
        return _exchanged(scene, cores)
    finally:
        for side, core in cores.items():
            core.restore(before[side])


def _exchanged(scene: Scene, cores: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    structure, flow = cores.get("structural"), cores.get("aero")
    dt = scene.communication_step
    if flow is not None:  # its first inputs are set in initialization mode
        _shown(scene, structure, flow, 0)
        flow.look()
    inputs: dict[str, list[list[Any]]] = {side: [] for side in cores}
    results = {side: [_row(core, 0.0, _results(core))] for side, core in cores.items()}
    try:
        for k in range(STEPS):
            if flow is not None:
                _shown(scene, structure, flow, k)
                _stepped(flow, k, dt, inputs["aero"], results["aero"])
            if structure is None:
                continue
            if flow is not None:
                for name in {v.name for v in flow.variables} & set(LOADS):
                    structure.set(name, flow.get(name))
            elif "pressure" in {v.name for v in structure.variables}:
                structure.set("pressure", np.full_like(structure.get("pressure"), k + 1.0))
            _stepped(structure, k, dt, inputs["structural"], results["structural"])
    except StepFailed:
        pass  # nothing of the step that failed is in the tables
    return {
        side: (_table(_inputs(core), inputs[side]), _table(_results(core), results[side]))
        for side, core in cores.items()
    }


def _shown(scene: Scene, structure: Any, flow: Any, k: int) -> None:
    """Give a flow the motion of a structure, or in step k that of a rigid wing."""
    if structure is None:
        nodes = scene.interface.nodes
        flow.set("displacement", scene.heading.started(nodes, {"trim_angle": PITCH * k}) - nodes)
        return
    for name in {v.name for v in flow.variables} & set(MOTION):
        flow.set(name, structure.get(name))


def options(steps: int, dt: float = 1.0) -> str:
    """Times, step and tolerances of results of so many steps, as the FMI cross-check rules name them."""
    named = {
        "StartTime": 0.0,
        "StopTime": steps * dt,
        "StepSize": dt,
        "RelTol": RELATIVE,
        "AbsTol": ABSOLUTE,
        "SolverType": "FixedStep",
        "OutputIntervalLength": dt,
    }
    return "".join(f"{name},{value}\n" for name, value in named.items())


def _inputs(core: Any) -> list[Variable]:
    return [v for v in core.variables if v.causality == "input"]


def _results(core: Any) -> list[Variable]:
    outputs = [v for v in core.variables if v.causality == "output"]
    return [v for v in outputs if (v.size <= 3 and v.name not in SOLVERS) or v.name in INTERFACE]


def _stepped(core: Any, k: int, dt: float, inputs: list[list[Any]], results: list[list[Any]]) -> None:
    given = _row(core, k * dt, _inputs(core))
    core.step(k * dt, dt)
    inputs.append(given)
    results.append(_row(core, (k + 1) * dt, _results(core)))


def _row(core: Any, time: float, variables: Sequence[Variable]) -> list[Any]:
    blocks = [np.ravel(core.get(v.name)).astype(float if v.kind == "real" else int).tolist() for v in variables]
    return [time, *(value for block in blocks for value in block)]


def _table(variables: Sequence[Variable], rows: Sequence[Sequence[Any]]) -> str:
    """CSV as in the FMI cross-check rules: names in quotes, numbers without, truth values as 0 and 1."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_NONNUMERIC)
    writer.writerow(["time", *(name for v in variables for name in scalar_names(v))])
    writer.writerows(rows)
    return text.getvalue()
