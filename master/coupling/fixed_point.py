"""The coupling loop: repeat x <- scheme(x, G(x) - x) until every field has converged, or say why not."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from interface import SimulationEnded, StepDiscarded
from master.coupling.acceleration import Field, Scheme
from master.coupling.admissible import Admissible
from master.coupling.convergence import (
    BLOWN,
    IDLE,
    ConvergenceMonitor,
    Tolerance,
    field_norms,
    norm,
    partition,
    required_count,
)
from master.coupling.recovery import Anchor, Loop, Progress, Recovery

Status = Literal["converged", "max_iterations", "diverged", "stalled", "terminated"]


class Floors(Protocol):
    """What `fixed_point` asks of rounding, see `master.coupling.rounding`."""

    def begin(self, names: list[str], parts: list[Field]) -> None:
        """Before the first evaluation."""

    def observe(self, x_tilde: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """After an evaluation, with the norms of the fields: the residual norms that are rounding by now."""

    def forget(self) -> None:
        """Unlearn the size of unknowns since `begin`: updates had blown them up."""

    def explains(self, monitor: ConvergenceMonitor) -> bool:
        """Whether what is left of the residuals is rounding, as they do not fall any more."""


@dataclass(frozen=True, eq=False)
class FixedPointResult:
    """End of a coupling loop.

    `x` is the last point where G was evaluated, so that the tested residual `x_tilde - x` belongs to it; `x_tilde` =
    G(x) is normally the better point. Both have the shape and unit of x0. `iterations` counts evaluations of G;
    `residual_norms` (iterations,) holds |r|_2 over all entries, `field_residual_norms` the same of each field.
    `recoveries` lists what went wrong on the way and was overcome (or was not, if the status is not "converged").
    `refused`: the last point is one that G does not take, however often it is asked.
    """

    x: np.ndarray
    x_tilde: np.ndarray
    status: Status
    iterations: int
    residual_norms: np.ndarray
    field_residual_norms: dict[str, np.ndarray]
    message: str
    recoveries: tuple[Recovery, ...] = ()
    refused: bool = False

    @property
    def converged(self) -> bool:
        """Whether the tolerances hold in every field."""
        return self.status == "converged"


def fixed_point(
    G: Callable[[np.ndarray], np.ndarray],
    x0: np.ndarray,
    scheme: Scheme,
    atol: Tolerance = 0.0,
    rtol: Tolerance = 0.0,
    residual_rtol: Tolerance = 0.0,
    max_iterations: int = 200,
    fields: Mapping[str, Field] | None = None,
    callback: Callable[[int, np.ndarray, np.ndarray, np.ndarray], object] | None = None,
    growth_limit: float = 1e6,
    stall_window: int = 30,
    recoveries: int = 3,
    anchor: Anchor | None = None,
    hold: Callable[[Progress], object] | None = None,
    progress: Progress | None = None,
    admissible: Admissible | None = None,
    floors: Floors | None = None,
) -> FixedPointResult:
    """Solve x = G(x) from x0 with an acceleration scheme.

    Converged means |r|_2 <= atol + rtol |x_tilde|_2 + residual_rtol |r_1|_2 in every field, with r = x_tilde - x. A
    tolerance is one number or one per field (mapping by name, or sequence in the order of `fields`). r_1 is the first
    residual of the field that is not zero to rounding; one that is zero to rounding has converged. Where x_tilde has
    outgrown the data (its first value and all residuals), tolerances and rounding that grew with it prove nothing: the
    residual must then have fallen by more than x_tilde has grown, or be rounding that is small beside the residuals.
    `fields` maps names to slices or index arrays of the flattened x and covers it exactly once (none where x has no
    entries). `callback(k, x, x_tilde, r)` follows each evaluation.

    Progress is measured as m = max over the fields of |r_f| / tolerance_f (tolerances of the first evaluation).
    "diverged": m exceeds `growth_limit` times its first value, tolerances hold only because x_tilde has outgrown the
    data more than a million times, something is not finite, or G or the scheme raises an ArithmeticError
    (FloatingPointError, OverflowError, ZeroDivisionError). "stalled": the smallest m so far has not
    fallen by 1 % within the last `stall_window` evaluations (0: never), nor is m on its way down from a transient: the
    smallest m of the latest half (or sixth) of the window is then 10 % below that of the half (sixth) before. It is
    "diverged" if the median of the latest half is more than three times that of the half before. Other exceptions of G
    pass through. Floating-point warnings in G are silent, because the outcome is checked. Bad arguments raise
    ValueError.

    Before a loop ends as diverged or stalled it tries again, at most `recoveries` times in all and once after a stall.
    An evaluation that failed is repeated half-way to the best point so far (at the first evaluation: where it was).
    After two failures in a row, growth or a stall the scheme restarts, more carefully, from the best point; schemes
    that know no more careful way (constant relaxation) end at once after growth or a stall. `anchor` restores the
    states that solvers with a memory had at that point. `hold(progress)` is called before every evaluation with what
    the loop needs to continue from there; given back as `progress`, with the scheme as it was then, the loop continues
    bitwise as it would have.

    `admissible` says which entries are whole numbers, which no scheme sees and no residual of which is tolerated, and
    between which bounds updates have to stay. `floors` learns from evaluations below which residuals rounding leaves
    nothing to gain, tolerances count from there; where G repeats itself to the last bit, x_tilde is tried next. A map
    that refuses a point for good (StepDiscarded) is not asked for it again, one that asks for the end (SimulationEnded)
    for nothing more; the status of that is "terminated".
    """
    _require(max_iterations, growth_limit, stall_window, recoveries)
    x0 = np.array(x0, dtype=float)
    if not np.all(np.isfinite(x0)) or (x0.size == 0 and fields is None):
        raise ValueError("x0 must have at least one entry and all its entries must be finite.")
    names, parts = partition(fields, x0.size)
    shape = x0.shape
    p = progress
    free = parts if admissible is None else admissible.free_parts(parts)
    if p is None:
        whole = np.zeros(x0.size, dtype=bool) if admissible is None else admissible.whole
        exact = [name for name, part in zip(names, parts, strict=True) if whole[part].any()]
        p = Progress(x0.ravel(), ConvergenceMonitor(names, atol, rtol, residual_rtol, exact))
        scheme.begin(free)
    if floors is not None:
        floors.begin(names, parts)
    loop = Loop(p, scheme, recoveries, anchor, admissible, free)
    ended: tuple[Status, str] | None = None
    while ended is None:
        if hold is not None:
            hold(p)
        k, x = p.evaluations + 1, p.x
        x_tilde, failure, error = _evaluate(G, x.reshape(shape), k)
        with np.errstate(all="ignore"):
            r = x_tilde - x
            norms = field_norms((r, x_tilde), parts)
            p.residual_norms.append(norm(r))
        p.field_norms.append(norms[:, 0])
        if callback is not None:
            callback(k, x.reshape(shape).copy(), x_tilde.reshape(shape).copy(), r.reshape(shape).copy())
        if not failure and not np.all(np.isfinite(norms)):
            failure = _not_finite(x_tilde, [] if fields is None else list(zip(names, parts, strict=True)), k)
        if isinstance(error, SimulationEnded):
            ended = "terminated", f"{str(error).rstrip('.')}."
        elif failure:
            again = k < max_iterations and loop.retreat(failure, not isinstance(error, StepDiscarded))
            ended = None if again else ("diverged", failure)
        else:
            if floors is not None:
                p.monitor.floors = floors.observe(x_tilde, norms[:, 1])
            ended = _judged(loop, x, r, norms, max_iterations, growth_limit, int(stall_window), floors)
    status, message = ended
    if admissible is None:
        scheme.end(status, x, r)
    else:
        scheme.end(status, admissible.free(x), admissible.free(r))
    return FixedPointResult(
        x=x.reshape(shape),
        x_tilde=x_tilde.reshape(shape),
        status=status,
        iterations=p.evaluations,
        residual_norms=np.array(p.residual_norms),
        field_residual_norms=dict(zip(names, np.array(p.field_norms).T, strict=True)),
        message=message,
        recoveries=tuple(p.recoveries),
        refused=isinstance(error, StepDiscarded),
    )


def _not_finite(x_tilde: np.ndarray, fields: Sequence[tuple[str, Field]], k: int) -> str:
    """A sentence on values of G that are not finite, with the names of the fields that have them."""
    bad = [name for name, part in fields if not np.isfinite(x_tilde[part]).all()]
    return f"G returned values that are not finite at evaluation {k}{': ' if bad else ''}{', '.join(bad)}."


def _require(max_iterations: int, growth_limit: float, stall_window: int, recoveries: int) -> None:
    required_count("max_iterations", max_iterations)
    if not growth_limit > 1.0 or stall_window < 0 or recoveries < 0:
        raise ValueError("growth_limit must be above 1, stall_window and recoveries not negative.")


def _judged(
    loop: Loop,
    x: np.ndarray,
    r: np.ndarray,
    norms: np.ndarray,
    max_iterations: int,
    growth_limit: float,
    stall_window: int,
    floors: Floors | None = None,
) -> tuple[Status, str] | None:
    """How the loop ends after an evaluation with finite `norms` (fields, 2) of r and x_tilde, None if it goes on."""
    p, monitor = loop.progress, loop.progress.monitor
    k = p.evaluations
    loop.notice(x)
    measure = monitor.measure(norms[:, 0], norms[:, 1])
    if monitor.converged:
        return "converged", f"Converged in {k} evaluations of G."
    if floors is not None and monitor.idle >= IDLE and monitor.blown <= BLOWN and floors.explains(monitor):
        return "converged", f"Converged to the rounding of what participants receive, in {k} evaluations of G."
    if monitor.improved or p.best is None:
        failure = loop.mark(x, r)
        if failure:
            return "diverged", f"After evaluation {k} {failure}."
    more = k < max_iterations
    failure = ""
    if measure > growth_limit * monitor.first:
        failure = (
            f"The residual grew to more than {growth_limit:g} times its first value in {k} evaluations of G; "
            f"{monitor.worst()}"
        )
    elif monitor.blown > BLOWN:
        if floors is not None:
            floors.forget()
        failure = (
            f"The unknowns grew to {monitor.blown:.1e} times the start and all residuals in {k} evaluations of G, and "
            "the residual did not fall with that: no fixed point is near."
        )
    if failure:
        return None if more and loop.restart(failure) else ("diverged", failure)
    if stall_window and monitor.stalled(stall_window):
        grows = monitor.grows(stall_window)
        failure = (
            f"The residual has {'grown' if grows else 'not fallen'} over the last {stall_window} evaluations of G; "
            f"{monitor.worst()}"
        )
        if more and not p.stalls and loop.restart(failure):
            p.stalls += 1
            return None
        return "diverged" if grows else "stalled", failure
    if not more:
        return "max_iterations", f"Not converged within {max_iterations} evaluations of G; {monitor.worst()}"
    failure = loop.advance(x, r)
    if floors is not None and loop.repeated(x + r) and not failure:
        p.x = x + r  # x does not matter to the last bit of G there, so that this is the fixed point, if any
    return ("diverged", f"After evaluation {k} {failure}.") if failure else None


def _evaluate(
    G: Callable[[np.ndarray], np.ndarray], x: np.ndarray, k: int
) -> tuple[np.ndarray, str, ArithmeticError | None]:
    """G(x) flattened, and a sentence if the arithmetic of G broke down (the values are nan then), with its error."""
    try:
        with np.errstate(all="ignore"):
            found = np.array(G(x.copy()))
    except ArithmeticError as error:
        builtin = type(error).__module__ == "builtins"
        reason = f"G raised {type(error).__name__}: {error}" if builtin else str(error)
        return np.full(x.size, np.nan), f"At evaluation {k} {reason.rstrip('.')}.", error
    if found.shape != x.shape:
        raise ValueError(f"G must return the shape of x0, {x.shape}, but returned {found.shape}.")
    if np.iscomplexobj(found):
        raise ValueError(f"G must return real numbers, but returned complex ones at evaluation {k}.")
    return found.astype(float).ravel(), "", None
