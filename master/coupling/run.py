"""One coupled run from participants to a record of it: solve, judge the stability, collect outputs."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from master.coupling.acceleration import Scheme
from master.coupling.equilibrium import CoupledResult, Coupling, solve
from master.coupling.stability import Stability, static_stability
from master.coupling.validity import Judgement

# Change of C_L from the start, as a factor either way, that a kite which turns and deforms does not make: 0.5 to 1.6
# are found on the intended branch.
LIFT_JUMP = 3.0


@dataclass(frozen=True, eq=False)
class Run:
    """A finished run: status, the coupled result, its stability (None: not asked for or not converged), the blocks of
    both participants at the end, their causality, remarks worth a line, how often each solver was called, and how far
    the result lies within what its models are known to be good for.
    """

    status: str
    message: str
    result: CoupledResult
    stability: Stability | None
    blocks: dict[str, dict[str, np.ndarray]]
    causality: dict[str, dict[str, str]]
    remarks: list[str]
    evaluations: int
    validity: list[Judgement] = field(default_factory=list)


def coupled_run(
    coupling: Coupling,
    scheme: Scheme,
    stability: bool = True,
    progress: Callable[[int, float], Any] | None = None,
    remark: Callable[[dict[str, np.ndarray]], list[str]] | None = None,
    **options: Any,
) -> Run:
    """Solve and judge. The status is that of the solve; "statically_unstable" for a converged unstable equilibrium; and
    where a kite no longer flies as one, what is the matter: "negative_lift", "crossed_cells", "lines_lost", and of a
    solve that did not converge "separated".

    `remark` says what is worth a line in the blocks of the flow at the end; `options` go to `master.coupling.solve`.
    RuntimeError with the reason if a solver has ended for good on the way.
    """
    result = solve(coupling, scheme, progress=progress, **options)
    judged = None
    status, message = result.status, result.message
    if status == "converged" and stability:
        begin = time.perf_counter()
        judged = static_stability(coupling, result.displacement)
        result.seconds["stability"] = time.perf_counter() - begin
        if judged.statically_stable is False:
            status = "statically_unstable"
            message = f"The equilibrium is statically unstable: {judged.message}."
    blocks, causality = dict[str, dict[str, np.ndarray]](), dict[str, dict[str, str]]()
    for label, participant in (("structural", coupling.structural), ("aero", coupling.aero)):
        try:
            blocks[label] = {b: participant.get(b) for b in participant.blocks}
        except (ValueError, RuntimeError) as error:  # of a solver that has ended: nothing to make a record of
            raise RuntimeError(message) from error
        causality[label] = dict(participant.causality)
    status, message = _as_flown(status, message, result.history, blocks)
    told = "recovered" if result.status == "converged" else "tried to recover"
    remarks = symmetry_remarks(blocks) + (remark(blocks["aero"]) if remark is not None else [])
    remarks += _iterate_remarks(result)
    remarks += _branch_remarks(result.history, blocks["aero"])
    remarks += _stability_remarks(judged) + [f"{told}: {r}" for r in result.recoveries]
    evaluations, validity = coupling.evaluations, coupling.validity()
    return Run(status, message, result, judged, blocks, causality, remarks, evaluations, validity)


def _as_flown(
    status: str, message: str, history: list[dict[str, float]], blocks: dict[str, dict[str, np.ndarray]]
) -> tuple[str, str]:
    """Status and message of a run whose kite does not fly any more as it did at the start; others as they are.

    Flow and structure answer for shapes that no kite keeps: upside down (ram-air thesis, algorithm 2, ends where the
    lift is below zero), with cells turned inside out, or on slack lines. Separated strips alone do not stop a solve,
    but they are why one does not end: loads of attached flow grow on.
    """
    flow, structure, solved = blocks["aero"], blocks["structural"], status == "converged"
    lift, first = float(flow.get("CL", np.nan)), history[0].get("aero.CL", np.nan) if history else np.nan
    ended = "" if solved else f" {message}"
    if crossed := int(np.nan_to_num(float(flow.get("crossed_strips", 0.0)))):
        at = int(flow["crossed_strips_at"])
        what = (
            f"The upper and the lower side of {crossed} strips went through each other, the first of them strip {at}."
        )
        return "crossed_cells", what + ended
    if "trim_angle" in structure and lift <= 0.0 < first:
        return "negative_lift", f"The kite flies upside down: C_L is {lift:.3g}, {first:.3g} at the start.{ended}"
    tension = structure.get("tension", np.zeros(0))
    if "trim_angle" in structure and len(tension) and float(structure.get("slack_lines", 0.0)) == len(tension):
        return "lines_lost", f"All {len(tension)} lines are slack: nothing holds the kite.{ended}"
    apart = np.flatnonzero(np.asarray(flow.get("separated", ())) > 0.0) + 1
    if not solved and status != "statically_unstable" and len(apart):
        more = f" and {len(apart) - 8} more" if len(apart) > 8 else ""
        strips = ", ".join(map(str, apart[:8]))
        return "separated", f"The flow separates on strips {strips}{more}, where there is no answer.{ended}"
    return status, message


def symmetry_remarks(blocks: dict[str, dict[str, np.ndarray]]) -> list[str]:
    """Whether a side could not solve one half as it was asked to."""
    remarks = []
    for label in ("structural", "aero"):
        wanted, used = blocks[label].get("symmetric"), blocks[label].get("symmetry_used")
        if wanted is not None and used is not None and bool(wanted) and not bool(used):
            remarks.append(f"symmetry was asked for but turned off in the {label} solver: its input is not symmetric")
    return remarks


def _iterate_remarks(result: CoupledResult) -> list[str]:
    """Which shape of a run that did not converge is written."""
    if result.status == "converged" or result.iterate is None:
        return []
    which = f"after coupling iteration {result.iterate} of {result.iterations}" if result.iterate else "of the start"
    return [f"not converged: all that is written is of one shape, that {which}"]


def _branch_remarks(history: list[dict[str, float]], flow: dict[str, np.ndarray]) -> list[str]:
    """Whether the lift is far from that of the start, the first row: then this may be another equilibrium than the one
    meant. Folded tips are judged by the flow itself (`validity`).
    """
    first, last = history[0].get("aero.CL", np.nan) if history else np.nan, float(flow.get("CL", np.nan))
    if first > 0.0 and not first / LIFT_JUMP <= last <= first * LIFT_JUMP:
        return [f"C_L is {last:.3g}, {first:.3g} at the start: perhaps another equilibrium than the one meant"]
    return []


def _stability_remarks(judged: Stability | None) -> list[str]:
    if judged is None:
        return []
    if judged.statically_stable is None:
        return [f"the static stability could not be decided: {judged.message}"]
    if judged.statically_stable and judged.symmetric_only:
        return ["stability was judged for mirror-symmetric motions only (symmetric = false tests all)"]
    return []
