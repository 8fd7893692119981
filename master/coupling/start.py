"""Where a transient scene begins: at rest, in the equilibrium of structure and flow together."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from master.coupling.participants import InProcessParticipant
from master.coupling.simulation import FLOW, STRUCTURE, equilibrium_is_asked_for, simulate

# Of the displacement, m, and tries to get there: a hundredth of what a communication step is solved to, so that what is
# left is no motion beside that of the run.
TOLERANCE, TRIES = 1e-8, 100


def with_start(
    scene: Any, parameters: Mapping[str, Any] | None = None, cores: Mapping[str, Any] | None = None
) -> tuple[Any, str]:
    """The scene with the coupled equilibrium under `parameters` for its start, and "" or why there is none.

    Only transient scenes with a flow that start in equilibrium have one; others come back as they are. `cores` of the
    scene (side -> core) that made no step yet take the parameters and are as they were otherwise. The equilibrium is
    that of the first communication step, in which the structure is at rest under the loads of the step.
    """
    if not (scene.transient and scene.has_flow):
        return scene, ""
    cores = dict(cores or scene.cores())
    given = scene.with_trim(parameters, cores)
    sides = {
        side: InProcessParticipant(core, {v.name: given[v.name] for v in core.variables if v.name in given})
        for side, core in cores.items()
    }
    if not equilibrium_is_asked_for(sides):
        return scene, ""
    before = {side: core.save() for side, core in cores.items()}
    drawn = cores[STRUCTURE].get("position"), cores[FLOW].get("displacement")
    try:
        step = scene.communication_step
        run = simulate(sides, step, step, tolerance=TOLERANCE, max_iterations=TRIES)
        found = cores[STRUCTURE].get("position"), cores[STRUCTURE].get("displacement")
    finally:
        for side, core in cores.items():
            core.restore(before[side])
    if not run.finished or not all(np.all(np.isfinite(a)) for a in found):
        return scene, f"no equilibrium of structure and flow to start from: {run.message}"
    return scene.starting_at(drawn, found), ""
