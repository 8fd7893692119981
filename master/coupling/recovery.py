"""What a coupling loop needs to recover: where it is, what went wrong, and how to continue."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from master.coupling.acceleration import Field
from master.coupling.admissible import Admissible
from master.coupling.convergence import ConvergenceMonitor

RETREAT = 0.5  # part of the way from the best x that is tried after an evaluation has failed


@dataclass(frozen=True)
class Recovery:
    """What went wrong after which evaluation of G, and what was done about it."""

    iteration: int
    reason: str
    remedy: str

    def __str__(self) -> str:
        after = "" if "evaluation" in self.reason else f"after evaluation {self.iteration}: "
        return f"{after}{self.reason}; {self.remedy}"


class Anchor(Protocol):
    """What G depends on beside x: warm starts, states of solvers."""

    def mark(self) -> None:
        """Remember the present state; the evaluation just made is the best so far."""

    def restore(self) -> None:
        """Return to the state that was marked last, or to that before the first evaluation."""


@dataclass
class Progress:
    """Where a loop is before an evaluation: enough to continue from, bitwise, together with the scheme.

    `x` (n,) is the next point; `best` the pair (x, r) with the smallest measure so far.
    """

    x: np.ndarray
    monitor: ConvergenceMonitor
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
        self.monitor.restart()


class Loop:
    """The ways from one evaluation to the next; each sets `progress.x`."""

    def __init__(
        self,
        progress: Progress,
        scheme: Any,
        recoveries: int,
        anchor: Anchor | None,
        admissible: Admissible | None = None,
        parts: Sequence[Field] = (),
    ):
        self.progress, self.scheme, self.recoveries, self.anchor = progress, scheme, recoveries, anchor
        self.admissible, self.parts = admissible, parts
        self._whole: np.ndarray | None = None  # whole numbers of the evaluation before
        self._x_tilde: np.ndarray | None = None  # of the evaluation before

    def mark(self, x: np.ndarray, r: np.ndarray) -> str:
        """Remember the best pair, and the state that goes with it; why that failed, if it did."""
        self.progress.best = x.copy(), r.copy()
        try:
            if self.anchor is not None:
                self.anchor.mark()
        except ArithmeticError as error:
            return str(error).rstrip(".")
        return ""

    def notice(self, x: np.ndarray) -> None:
        """Before an evaluation at x counts: where its whole numbers are others than those of the one before, the map is
        another, across which the scheme takes no difference and residuals are not compared.
        """
        if self.admissible is not None and self.admissible.whole.any():
            whole, self._whole = self._whole, x[self.admissible.whole]
            if whole is not None and not np.array_equal(whole, self._whole):
                self.scheme.begin(self.parts)
                self.progress.monitor.renew()

    def repeated(self, x_tilde: np.ndarray) -> bool:
        """Whether G gave the same to the last bit as the time before."""
        same = self._x_tilde is not None and np.array_equal(x_tilde, self._x_tilde)
        self._x_tilde = x_tilde
        return same

    def advance(self, x: np.ndarray, r: np.ndarray) -> str:
        """By the scheme; an update that fails or is not finite makes it restart. Why there is none, if so."""
        reason = self._update(x, r)
        return "" if not reason or self.restart(reason) else reason

    def _update(self, x: np.ndarray, r: np.ndarray) -> str:
        """Set the next x; why that failed, if it did."""
        try:
            with np.errstate(all="ignore"):
                x_next = self._stepped(x, r)
        except ArithmeticError as error:
            return str(error).rstrip(".")
        if not np.all(np.isfinite(x_next)):
            return "the update was not finite"
        self.progress.x = x_next
        return ""

    def _stepped(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """The next x of the scheme, which sees no whole numbers."""
        allowed = self.admissible
        if allowed is None:
            stepped: np.ndarray = self.scheme.step(x, r)
            return stepped
        x_next = x + r
        if not allowed.whole.all():
            x_next[~allowed.whole] = self.scheme.step(allowed.free(x), allowed.free(r))
        return allowed.clipped(x_next, x + r)

    def retreat(self, reason: str, again: bool = True) -> bool:
        """Half-way to the best point after an evaluation that failed; False if nothing is left to try.

        If that failed too, the scheme restarts where it can. Where no evaluation has succeeded yet there is no
        other point: the same is tried once more, in case the failure was a passing one, but not where it would not be
        (`again` False).
        """
        p = self.progress
        if p.best is None and not again:
            return False
        if len(p.recoveries) >= (self.recoveries if p.best is not None else min(1, self.recoveries)):
            return False
        if p.recoveries and p.recoveries[-1].iteration == p.evaluations - 1 and self.restart(reason):
            return True
        remedy = "tried again"
        if p.best is not None:
            p.x, remedy = p.best[0] + RETREAT * (p.x - p.best[0]), "tried again half-way to the best point"
            if self.admissible is not None:
                p.x = np.where(self.admissible.whole, p.best[0], p.x)
        if not self._restore():
            return False
        p.recovered(reason, remedy)
        return True

    def restart(self, reason: str) -> bool:
        """From the best point with the scheme restarted; False if that is not possible."""
        p, restart = self.progress, getattr(self.scheme, "restart", None)
        if len(p.recoveries) >= self.recoveries or restart is None or p.best is None or not restart():
            return False
        # states first: a scheme may ask the solvers for derivatives, which are those of the best point then
        if not self._restore() or self._update(*p.best):
            return False
        p.recovered(reason, "the scheme was restarted from the best point")
        return True

    def _restore(self) -> bool:
        """Restore what was marked; False if that fails, which ends the loop."""
        try:
            if self.anchor is not None:
                self.anchor.restore()
        except ArithmeticError:
            return False
        return True
