"""The coupling loop: repeat x <- scheme(x, G(x) - x) until every field has converged, or say why not."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np

from master.acceleration import Field, Scheme
from master.convergence import Test, Tolerance, norm, partition

Status = Literal["converged", "max_iterations", "diverged", "stalled"]

RETREAT = 0.5  # part of the way from the best x that is tried after an evaluation has failed


@dataclass(frozen=True)
class Recovery:
    """What went wrong after which evaluation of G, and what was done about it."""

    iteration: int
    reason: str
    remedy: str

    def __str__(self) -> str:
        return f"after evaluation {self.iteration}: {self.reason}; {self.remedy}"


class Anchor(Protocol):
    """What G depends on beside x: warm starts, states of solvers."""

    def mark(self) -> None:
        """Remember the present state; the evaluation just made is the best so far."""

    def restore(self) -> None:
        """Return to the state that was marked last, or to that before the first evaluation."""


@dataclass
class Progress:
    """Where a loop stands before an evaluation: enough to go on from, bitwise, together with the scheme.

    `x` (n,) is the next point; `best` the pair (x, r) with the smallest measure so far.
    """

    x: np.ndarray
    test: Test
    residual_norms: list[float] = field(default_factory=list)
    field_norms: list[np.ndarray] = field(default_factory=list)
    best: tuple[np.ndarray, np.ndarray] | None = None
    recoveries: list[Recovery] = field(default_factory=list)
    stalls: int = 0

    @property
    def evaluations(self) -> int:
        """Evaluations of G so far."""
        return len(self.residual_norms)

    def recovered(self, reason: str, remedy: str) -> None:
        """Book a recovery; what was before it does not count as time without progress."""
        self.recoveries.append(Recovery(self.evaluations, reason.rstrip("."), remedy))
        self.test.begin_anew()


@dataclass(frozen=True, eq=False)
class FixedPointResult:
    """End of a coupling loop.

    `x` is the last point where G was evaluated, so that the tested residual `x_tilde - x` belongs to it; `x_tilde` =
    G(x) is normally the better point. Both have the shape and unit of x0. `iterations` counts evaluations of G;
    `residual_norms` (iterations,) holds |r|_2 over all entries, `field_residual_norms` the same of each field.
    `recoveries` lists what went wrong on the way and was overcome (or was not, if the status is not "converged").
    """

    x: np.ndarray
    x_tilde: np.ndarray
    status: Status
    iterations: int
    residual_norms: np.ndarray
    field_residual_norms: dict[str, np.ndarray]
    message: str
    recoveries: tuple[Recovery, ...] = ()

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
    growth_limit: float = 1e4,
    stall_window: int = 30,
    recoveries: int = 3,
    anchor: Anchor | None = None,
    hold: Callable[[Progress], object] | None = None,
    progress: Progress | None = None,
) -> FixedPointResult:
    """Solve x = G(x) from x0 with an acceleration scheme.

    Converged means |r|_2 <= atol + rtol |x_tilde|_2 + residual_rtol |r_1|_2 in every field, with r = x_tilde - x. A
    tolerance is one number or one per field (mapping by name, or sequence in the order of `fields`). r_1 is the first
    residual of the field that is not zero to rounding; one that is zero to rounding has converged. `fields` maps names
    to slices or index arrays of the flattened x and covers it exactly once (none where x has no entries).
    `callback(k, x, x_tilde, r)` follows each evaluation.

    Progress is measured as m = max over the fields of |r_f| / tolerance_f (tolerances of the first evaluation).
    "diverged": m exceeds `growth_limit` times its first value, something is not finite, or G or the scheme raises an
    ArithmeticError (FloatingPointError, OverflowError, ZeroDivisionError). "stalled": the smallest m so far has not
    fallen by 1 % within the last `stall_window` evaluations (0: never), nor is m on its way down from a transient: the
    smallest m of the latest half (or sixth) of the window is then 10 % below that of the half (sixth) before. Other
    exceptions of G pass through. Floating-point warnings in G are silent, because the outcome is checked. Bad arguments
    raise ValueError.

    Before a loop ends as diverged or stalled it tries again, at most `recoveries` times in all and once after a stall.
    An evaluation that failed is repeated half-way to the best point so far (at the first evaluation: where it was).
    After two failures in a row, growth or a stall the scheme begins anew, more carefully, from the best point; schemes
    that know no more careful way (constant relaxation) end at once after growth or a stall. `anchor` puts solvers with
    a memory back where they were at that point. `hold(progress)` is called before every evaluation with what the loop
    needs to go on from there; given back as `progress`, with the scheme as it was then, the loop continues bitwise as
    it would have.
    """
    if isinstance(max_iterations, bool) or int(max_iterations) != max_iterations or max_iterations < 1:
        raise ValueError(f"max_iterations must be a whole number >= 1, got {max_iterations}.")
    if not growth_limit > 1.0 or stall_window < 0 or recoveries < 0:
        raise ValueError("growth_limit must be above 1, stall_window and recoveries not negative.")
    x0 = np.array(x0, dtype=float)
    if not np.all(np.isfinite(x0)) or (x0.size == 0 and fields is None):
        raise ValueError("x0 must have at least one entry and all its entries must be finite.")
    names, parts = partition(fields, x0.size)
    shape = x0.shape
    if progress is None:
        p = Progress(x0.ravel(), Test(names, atol, rtol, residual_rtol))
        scheme.begin(parts)
    else:
        p = progress
    loop = _Loop(p, scheme, recoveries, anchor)
    status: Status = "max_iterations"
    message = f"Not converged within {max_iterations} evaluations of G."
    while True:
        if hold is not None:
            hold(p)
        k, x = p.evaluations + 1, p.x
        x_tilde, failure = _evaluate(G, x.reshape(shape), k)
        with np.errstate(all="ignore"):
            r = x_tilde - x
            r_f = np.array([norm(r[f]) for f in parts])
            size_f = np.array([norm(x_tilde[f]) for f in parts])
            p.residual_norms.append(norm(r))
        p.field_norms.append(r_f)
        if callback is not None:
            callback(k, x.reshape(shape).copy(), x_tilde.reshape(shape).copy(), r.reshape(shape).copy())
        if failure or not (np.all(np.isfinite(r_f)) and np.all(np.isfinite(size_f))):
            failure = failure or f"G returned values that are not finite at evaluation {k}."
            if k < max_iterations and loop.retreat(failure):
                continue
            status, message = "diverged", failure
            break
        measure = p.test.measure(r_f, size_f)
        if p.test.converged:
            status, message = "converged", f"Converged in {k} evaluations of G."
            break
        if p.test.improved or p.best is None:
            failure = loop.mark(x, r)
            if failure:
                status, message = "diverged", f"After evaluation {k} {failure}."
                break
        if measure > growth_limit * p.test.first:
            failure = f"The residual grew to more than {growth_limit:g} times its first value in {k} evaluations of G."
            if k < max_iterations and loop.begin_anew(failure):
                continue
            status, message = "diverged", failure
            break
        if stall_window and p.test.stalled(int(stall_window)):
            failure = f"The residual has not fallen during the last {stall_window} evaluations of G."
            if k < max_iterations and not p.stalls and loop.begin_anew(failure):
                p.stalls += 1
                continue
            status, message = "stalled", failure
            break
        if k >= max_iterations:
            break
        failure = loop.advance(x, r)
        if failure:
            status, message = "diverged", f"After evaluation {k} {failure}."
            break
    scheme.end(status, x, r)
    return FixedPointResult(
        x=x.reshape(shape),
        x_tilde=x_tilde.reshape(shape),
        status=status,
        iterations=p.evaluations,
        residual_norms=np.array(p.residual_norms),
        field_residual_norms=dict(zip(names, np.array(p.field_norms).T, strict=True)),
        message=message,
        recoveries=tuple(p.recoveries),
    )


class _Loop:
    """The ways from one evaluation to the next; each sets `progress.x`."""

    def __init__(self, progress: Progress, scheme: Any, recoveries: int, anchor: Anchor | None):
        self.progress, self.scheme, self.recoveries, self.anchor = progress, scheme, recoveries, anchor

    def mark(self, x: np.ndarray, r: np.ndarray) -> str:
        """Remember the best pair, and the state that goes with it; why that failed, if it did."""
        self.progress.best = x.copy(), r.copy()
        try:
            if self.anchor is not None:
                self.anchor.mark()
        except ArithmeticError as error:
            return str(error).rstrip(".")
        return ""

    def advance(self, x: np.ndarray, r: np.ndarray) -> str:
        """By the scheme; an update that fails or is not finite makes it begin anew. Why there is none, if so."""
        reason = self._update(x, r)
        return "" if not reason or self.begin_anew(reason) else reason

    def _update(self, x: np.ndarray, r: np.ndarray) -> str:
        """Set the next x; why that failed, if it did."""
        try:
            with np.errstate(all="ignore"):
                x_next = self.scheme.step(x, r)
        except ArithmeticError as error:
            return str(error).rstrip(".")
        if not np.all(np.isfinite(x_next)):
            return "the update was not finite"
        self.progress.x = x_next
        return ""

    def retreat(self, reason: str) -> bool:
        """Half-way to the best point after an evaluation that failed; False if nothing is left to try.

        If that failed too, the scheme begins anew where it can.
        """
        p = self.progress
        if len(p.recoveries) >= self.recoveries:
            return False
        if p.recoveries and p.recoveries[-1].iteration == p.evaluations - 1 and self.begin_anew(reason):
            return True
        remedy = "tried again"
        if p.best is not None:
            p.x, remedy = p.best[0] + RETREAT * (p.x - p.best[0]), "tried again half-way to the best point"
        if not self._restore():
            return False
        p.recovered(reason, remedy)
        return True

    def begin_anew(self, reason: str) -> bool:
        """From the best point with the scheme begun anew; False if that is not possible."""
        p, restart = self.progress, getattr(self.scheme, "restart", None)
        if len(p.recoveries) >= self.recoveries or restart is None or p.best is None or not restart():
            return False
        # states first: a scheme may ask the solvers for derivatives, which are those of the best point then
        if not self._restore() or self._update(*p.best):
            return False
        p.recovered(reason, "the scheme began anew from the best point")
        return True

    def _restore(self) -> bool:
        """Put back what was marked; False if that fails, which ends the loop."""
        try:
            if self.anchor is not None:
                self.anchor.restore()
        except ArithmeticError:
            return False
        return True


def _evaluate(G: Callable[[np.ndarray], np.ndarray], x: np.ndarray, k: int) -> tuple[np.ndarray, str]:
    """G(x) flattened, and a sentence if the arithmetic of G broke down (the values are nan then)."""
    try:
        with np.errstate(all="ignore"):
            x_tilde = np.array(G(x.copy()), dtype=float)
    except ArithmeticError as error:
        builtin = type(error).__module__ == "builtins"
        reason = f"G raised {type(error).__name__}: {error}" if builtin else str(error)
        return np.full(x.size, np.nan), f"At evaluation {k} {reason.rstrip('.')}."
    if x_tilde.shape != x.shape:
        raise ValueError(f"G must return the shape of x0, {x.shape}, but returned {x_tilde.shape}.")
    return x_tilde.ravel(), ""
