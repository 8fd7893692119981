"""The steady driver: one fixed point of an exchange in pseudo-time, tested by whatever the run is after."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from master.coupling.acceleration import Scheme
from master.coupling.convergence import Tolerance
from master.coupling.exchange import Exchange, Order, StateSnapshot
from master.coupling.fixed_point import FixedPointResult, fixed_point
from master.coupling.recovery import Progress, Recovery


@dataclass
class Search:
    """Where a steady run is: what it needs, with the states of the participants, to continue.

    `x` (unknowns,) is where the present loop began; `tighter` multiplies the tolerances given; `history` has a row per
    evaluation; `best` are the states of the participants at the best point and their clock, once, after a checkpoint
    was read.
    """

    order: Order
    x: np.ndarray
    tighter: float = 1.0
    history: list[dict[str, float]] = field(default_factory=list)
    recoveries: list[Recovery] = field(default_factory=list)
    loop: Progress | None = None
    best: tuple[dict[str, Any], tuple[float, int]] | None = None


@dataclass(frozen=True)
class Verdict:
    """What a goal says of the end of a loop: status and message of the run; `residual` of its own criterion, nan
    without one; and, where the run is to continue, by how much `tighter` the tolerances become, and by which `scheme`
    if by another.
    """

    status: str
    message: str
    residual: float = float("nan")
    tighter: float | None = None
    scheme: Scheme | None = None


class Goal:
    """What a steady run is after: here no more than its tolerances, those of `fixed_point`."""

    def __init__(self, atol: Tolerance = 0.0, rtol: Tolerance = 0.0, residual_rtol: Tolerance = 0.0) -> None:
        self._tolerances: tuple[Tolerance, Tolerance, Tolerance] = (atol, rtol, residual_rtol)

    def begin(self) -> None:
        """Before the first evaluation of a run that was not begun before."""

    def tolerances(self, tighter: float) -> tuple[Tolerance, Tolerance, Tolerance]:
        """atol, rtol and residual_rtol of a loop."""
        return self._tolerances

    def observed(self, x: np.ndarray, x_tilde: np.ndarray, r: np.ndarray, search: Search) -> dict[str, float]:
        """What the history keeps of an evaluation."""
        return {"residual": float(np.linalg.norm(r))}

    def verdict(self, found: FixedPointResult, search: Search, max_iterations: int) -> Verdict:
        """What the end of a loop means."""
        return Verdict(found.status, found.message)


@dataclass(frozen=True, eq=False)
class SteadyResult:
    """End of a steady run: the last loop `found`, status and message, `residual` by the criterion of the goal;
    `history`, a row per evaluation, `seconds` total and of each participant, `recoveries` what went wrong on the way.
    """

    found: FixedPointResult
    status: str
    message: str
    residual: float
    history: list[dict[str, float]]
    seconds: dict[str, float]
    recoveries: list[Recovery]


def steady(
    exchange: Exchange,
    scheme: Scheme,
    goal: Goal,
    order: Order = "serial",
    max_iterations: int = 200,
    recoveries: int = 3,
    search: Search | None = None,
    hold: Callable[[Search, StateSnapshot], object] | None = None,
) -> SteadyResult:
    """The fixed point of an exchange from what it sends back now; every evaluation is a step in pseudo-time.

    No state is restored unless an evaluation failed. Loops of `fixed_point` follow one another until the `goal` is
    content. `hold(search, snapshot)` is called before every evaluation with what a checkpoint needs, but in loops with
    a scheme of the goal's; a `search` from one continues there. Participants with a memory that cannot restore their
    state leave no way to recover. StepFailed where a participant cannot save its state.
    """
    begin, before = time.perf_counter(), dict(exchange.seconds)
    if search is None:
        search = Search(order, exchange.present(order))
        goal.begin()
    while True:
        found = _loop(exchange, scheme, goal, search, max_iterations, recoveries, hold)
        verdict = goal.verdict(found, search, max_iterations)
        if verdict.tighter is None:
            break
        if verdict.scheme is not None:
            scheme, hold = verdict.scheme, None
        search.x = found.x_tilde if verdict.scheme is None else exchange.present(search.order)
        search.tighter *= verdict.tighter
    seconds = {name: exchange.seconds[name] - before[name] for name in before}
    seconds["total"] = time.perf_counter() - begin
    return SteadyResult(
        found, verdict.status, verdict.message, verdict.residual, search.history, seconds, search.recoveries
    )


def _loop(
    exchange: Exchange,
    scheme: Scheme,
    goal: Goal,
    search: Search,
    max_iterations: int,
    recoveries: int,
    hold: Callable[[Search, StateSnapshot], object] | None,
) -> FixedPointResult:
    """One fixed point at the present tolerances."""
    snapshot = None if exchange.without_rollback() else StateSnapshot(exchange, search.best)
    progress, search.loop, search.best = search.loop, None, None
    done = len(search.history) if progress is None else len(search.history) - progress.evaluations

    def observe(k: int, x: np.ndarray, x_tilde: np.ndarray, r: np.ndarray) -> None:
        row = {"iteration": float(len(search.history) + 1)} | goal.observed(x, x_tilde, r, search)
        if search.history:  # what the update that led here used
            row |= getattr(scheme, "record", {})
        search.history.append(row)

    def held(loop: Progress) -> None:
        if hold is not None and snapshot is not None:
            search.loop = loop
            hold(search, snapshot)

    atol, rtol, residual_rtol = goal.tolerances(search.tighter)
    try:
        found = fixed_point(
            lambda x: exchange.evaluate(x, search.order),
            search.x,
            scheme,
            atol,
            rtol,
            residual_rtol,
            max(1, max_iterations - done),  # 0: a restart with fewer than were made
            exchange.fields(search.order),
            callback=observe,
            recoveries=0 if snapshot is None else recoveries,
            anchor=snapshot,
            hold=held,
            progress=progress,
        )
    finally:
        if snapshot is not None:
            snapshot.close()
    search.loop = None
    search.recoveries += found.recoveries
    return found
