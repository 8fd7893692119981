"""A rigid wing in a flow: the flow is solved once, and nothing is coupled."""

import time
from collections.abc import Callable

import numpy as np

from interface import StepFailed
from master.coupling.equilibrium import CoupledResult
from master.coupling.participants import Participant
from master.coupling.run import Run, symmetry_remarks
from master.coupling.validity import judgements

NOTHING = float("nan")


def rigid_run(aero: Participant, remark: Callable[[dict[str, np.ndarray]], list[str]] | None = None) -> Run:
    """One step of the flow around the shape that it has, as a run without coupling iterations and residuals.

    The status is "converged", or "diverged" where the flow has no answer there: its outputs are nan then. `remark` says
    what is worth a line in its blocks. The time is that of the step and, of an FMU, of its initialisation, in which it
    has solved the flow already. RuntimeError with the reason if the solver has ended for good.
    """
    begin = time.perf_counter()
    status, message = "converged", "The flow around the rigid wing is solved."
    try:
        aero.step(0.0, 1.0)
    except StepFailed as error:
        status, message = "diverged", f"The flow around the rigid wing has no answer: {str(error).rstrip('.')}."
    took = time.perf_counter() - begin + getattr(aero, "initialisation_s", 0.0)
    blocks = {name: aero.get(name) for name in aero.blocks}
    if status != "converged":
        outputs = [name for name in blocks if aero.causality[name] == "output"]
        blocks |= {name: np.full_like(blocks[name], np.nan) for name in outputs}
    seconds = {"total": took, "structural": 0.0, "aero": took}
    result = CoupledResult(blocks["displacement"], status, message, 0, NOTHING, NOTHING, [], seconds)
    of_sides = {"structural": dict[str, np.ndarray](), "aero": blocks}
    causality = {"structural": dict[str, str](), "aero": dict(aero.causality)}
    if status != "converged":
        return Run(status, message, result, None, of_sides, causality, [], 1)
    remarks = symmetry_remarks(of_sides) + ([] if remark is None else remark(blocks))
    return Run(status, message, result, None, of_sides, causality, remarks, 1, judgements({"aero": aero}))
