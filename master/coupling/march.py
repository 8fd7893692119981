"""The transient driver: communication step by communication step, each a fixed point of the exchange.

A step begins at a prediction: what is sent back, extrapolated in time.
"""

import contextlib
from array import array
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from interface import StepFailed
from master.coupling.acceleration import ConstantRelaxation, NewtonKrylov, Scheme
from master.coupling.admissible import Admissible
from master.coupling.convergence import ANY, Tolerance
from master.coupling.exchange import Exchange, Order, StateSnapshot
from master.coupling.fixed_point import FixedPointResult, fixed_point
from master.coupling.recovery import Recovery
from master.coupling.rounding import ExchangeFloors, Rounding

STATUSES = ("converged", "recovered", "max_iterations", "diverged", "stalled", "terminated")
GOOD = ("converged", "recovered")
MOST_STEPS = 1e12  # of a run; beyond it a step is rounding of the time
UNSAVED = "use the explicit scheme, which repeats no step, or declare a participant without memory memoryless"
MESSAGES = 100  # sentences kept, so that a long run with many of them does not grow
PREDICTORS = ("constant", "linear", "quadratic")


@dataclass
class Predictor:
    """Start of a communication step: extrapolation of the last accepted unknowns in time, of degree 0, 1 or 2.

    While there are fewer accepted steps than the degree asks for, it is the highest that they allow.
    """

    kind: str = "linear"
    _times: deque[float] = field(init=False, repr=False)
    _values: deque[np.ndarray] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in PREDICTORS:
            raise ValueError(f"there is no predictor '{self.kind}'; choose one of: {', '.join(PREDICTORS)}.")
        self._times, self._values = (deque(maxlen=PREDICTORS.index(self.kind) + 1) for _ in range(2))

    def add(self, time: float, x: np.ndarray) -> None:
        """Take the accepted unknowns (n,) at a time s."""
        self._times.append(time)
        self._values.append(np.array(x))

    def at(self, time: float) -> np.ndarray:
        """The unknowns (n,) expected at a time s (Lagrange)."""
        t = np.array(self._times)
        weights = [np.prod([(time - b) / (a - b) for j, b in enumerate(t) if j != i]) for i, a in enumerate(t)]
        return np.sum([w * x for w, x in zip(weights, self._values, strict=True)], axis=0)

    def known(self) -> list[tuple[float, np.ndarray]]:
        """Times s and accepted unknowns (n,), oldest first."""
        return list(zip(self._times, self._values, strict=True))

    def forget(self) -> None:
        """Keep only the last accepted unknowns."""
        while len(self._times) > 1:
            self._times.popleft()
            self._values.popleft()


@dataclass
class Steps:
    """All communication steps, a few bytes each: end time s, status, evaluations, last residual norm, recoveries.

    `messages` (step number from 1, sentence) are the last of steps that did not simply converge.
    """

    times: array = field(default_factory=lambda: array("d"))
    codes: array = field(default_factory=lambda: array("b"))
    iterations: array = field(default_factory=lambda: array("l"))
    residuals: array = field(default_factory=lambda: array("d"))
    recoveries: array = field(default_factory=lambda: array("h"))
    messages: deque[tuple[int, str]] = field(default_factory=lambda: deque(maxlen=MESSAGES))

    def __len__(self) -> int:
        return len(self.times)

    @property
    def statuses(self) -> list[str]:
        """The status of every step."""
        return [STATUSES[code] for code in self.codes]

    def count(self, status: str) -> int:
        """How many steps ended with a status."""
        return self.codes.count(STATUSES.index(status))

    def append(self, time: float, status: str, iterations: int, residual: float, recoveries: int) -> None:
        """Book a step."""
        self.times.append(time)
        self.codes.append(STATUSES.index(status))
        self.iterations.append(iterations)
        self.residuals.append(residual)
        self.recoveries.append(min(recoveries, 32767))

    def drop(self) -> None:
        """Take the last step out of the book, all but its messages: it was tried only."""
        for column in (self.times, self.codes, self.iterations, self.residuals, self.recoveries):
            column.pop()


@dataclass
class March:
    """Where a transient run is after a communication step: with the states and the clock of the exchange, all
    of it. `x` (unknowns,) is what is sent back, `fields` which entries of it are whose.
    """

    x: np.ndarray
    fields: dict[str, slice]
    predictor: Predictor
    steps: Steps = field(default_factory=Steps)
    rounding: Rounding | None = None

    @classmethod
    def beginning(cls, exchange: Exchange, order: Order, predictor: str) -> "March":
        """Where the exchange is before its first step."""
        now = cls(exchange.present(order), exchange.fields(order), Predictor(predictor))
        now.predictor.add(exchange.time, now.x)
        return now

    def require_fields(self, exchange: Exchange, order: Order) -> None:
        """ValueError in one sentence if what is sent back in an exchange is not what was."""
        if self.fields != exchange.fields(order):
            was, here = (", ".join(fields) or "none" for fields in (self.fields, exchange.fields(order)))
            raise ValueError(
                f"the run to continue has the unknowns {was}, but in order {order} they are {here} here; continue with "
                "the order and the connections of then."
            )

    def use_predictor(self, predictor: str) -> None:
        """Go on with a kind of predictor, which may be another than before."""
        if self.predictor.kind != predictor:
            was, self.predictor = self.predictor, Predictor(predictor)
            for t, x in was.known():
                self.predictor.add(t, x)


@dataclass(frozen=True, eq=False)
class MarchResult:
    """End of a transient run: "converged" if every step did (some may have recovered), "terminated" where a participant
    asked for the end before the stop time, else the status of the first step that did not converge, with why.
    `x` (unknowns,) is what is sent back at the end, `time` s how far it came.
    """

    status: str
    message: str
    time: float
    x: np.ndarray
    steps: Steps
    evaluations: int
    seconds: dict[str, float]


def march(
    exchange: Exchange,
    scheme: Scheme | None,
    stop_time: float,
    order: Order = "serial",
    predictor: str = "linear",
    atol: Tolerance = 0.0,
    rtol: Tolerance = 1e-6,
    residual_rtol: Tolerance = 0.0,
    max_iterations: int = 100,
    strict: bool = True,
    recoveries: int = 3,
    callback: Callable[[float, FixedPointResult], object] | None = None,
    hold: Callable[[March], object] | None = None,
    begun: March | None = None,
) -> MarchResult:
    """Step an exchange with `rollback` from its time to `stop_time` s; every communication step is solved to tolerance.

    `scheme` None is the explicit scheme: one exchange a communication step and no iteration, and no state is saved
    where it has no `recoveries` (nor by other schemes where nothing is sent back). Implicit schemes repeat a
    step from the states at its beginning, from a `predictor` of what is sent back; tolerances are those of
    `fixed_point`. A step that does not converge is tried once more, without extrapolation and with the scheme
    restarted. If that fails too the run ends (`strict`), or it continues with what was reached and its status says so.
    `callback(time, result)` follows every accepted step, `hold(march)` too, with what a checkpoint needs (once where
    no step is left to make); a StepFailed of theirs ends the run with its status. `begun` from a checkpoint continues
    there.

    ValueError in one sentence where a participant with a memory cannot restore its state and the scheme is implicit.
    """
    if not exchange.rollback:
        raise ValueError("the exchange advances in time with every evaluation; make it with rollback = True.")
    if scheme is not None and exchange.fields(order):
        exchange.require_rollback()
    once = (scheme is None or not exchange.fields(order)) and recoveries == 0
    count = _count(exchange, stop_time)
    now = begun or March.beginning(exchange, order, predictor)
    now.require_fields(exchange, order)
    now.use_predictor(predictor)
    settings: dict[str, Any] = {"atol": atol, "rtol": rtol, "residual_rtol": residual_rtol}
    settings |= {"max_iterations": max_iterations, "fields": exchange.fields(order), "recoveries": recoveries}
    allowed = exchange.admissible(order)
    now.rounding = now.rounding or Rounding()
    settings |= {"admissible": allowed, "floors": ExchangeFloors(now.rounding, exchange)}
    status, message = _so_far(now.steps, count)
    try:
        if count == 0 and hold is not None:
            hold(now)
        for _ in range(count):
            try:
                exchange.open(order, once)
            except StepFailed as error:
                if status == "converged":
                    status = "diverged"
                    message = f"Communication step {len(now.steps) + 1}, from {exchange.time:g} s: {error}; {UNSAVED}."
                break
            if scheme is None:
                ended, found = _explicit_step(exchange, now, order, recoveries)
            else:
                ended, found = _implicit_step(exchange, scheme, now, order, settings)
            if ended not in GOOD and status == "converged":
                status = ended
                where = f"Communication step {len(now.steps)}, to {exchange.end:g} s: "
                message = f"{'' if ended == 'terminated' else where}{found.message}"
            lost = ended == "terminated" or not np.all(np.isfinite([*found.x_tilde, found.residual_norms[-1]]))
            if ended not in GOOD and (strict or lost):
                with contextlib.suppress(StepFailed):  # of a participant that has ended
                    exchange.rewind()
                break
            now.x = found.x_tilde
            exchange.accept()
            now.predictor.add(exchange.time, now.x)
            try:
                if callback is not None:
                    callback(exchange.time, found)
                if hold is not None:
                    hold(now)
            except StepFailed as error:
                if status == "converged":
                    status = "diverged"
                    message = f"After communication step {len(now.steps)}, at {exchange.time:g} s: {error}."
                break
    finally:
        exchange.abandon()
    return MarchResult(status, message, exchange.time, now.x, now.steps, exchange.evaluations, dict(exchange.seconds))


def _so_far(steps: Steps, count: int) -> tuple[str, str]:
    """Status and message of a run whose next `count` steps converge: those of the first step that did not."""
    for k, earlier in enumerate(steps.statuses):
        if earlier not in GOOD:
            return earlier, f"Communication step {k + 1}, to {steps.times[k]:g} s, did not converge."
    return "converged", f"All {len(steps) + count} communication steps converged."


def _count(exchange: Exchange, stop_time: float) -> int:
    """Steps to a stop time s; ValueError in one sentence if that does not suit."""
    begin, dt = exchange.time, exchange.dt
    if not (np.isfinite(stop_time) and stop_time >= begin):
        raise ValueError(f"the stop time {stop_time:g} s must not lie before the start, {begin:g} s.")
    if not (stop_time - begin) / dt < MOST_STEPS:
        raise ValueError(f"to {stop_time:g} s there are more than {MOST_STEPS:g} steps of {dt:g} s; change one.")
    count = round((stop_time - begin) / dt)
    if abs(begin + count * dt - stop_time) > 1e-6 * dt:
        raise ValueError(f"from {begin:g} s to {stop_time:g} s is no whole number of steps of {dt:g} s.")
    return count


def _implicit_step(
    exchange: Exchange, scheme: Scheme, now: March, order: Order, settings: dict[str, Any]
) -> tuple[str, FixedPointResult]:
    """Status and result of one step, at most two attempts."""

    def attempt(x: np.ndarray) -> FixedPointResult:
        if not isinstance(scheme, NewtonKrylov):  # evaluations begin at the states of the step by themselves
            return _solved(exchange, scheme, x, order, **settings)
        snapshot = StateSnapshot(exchange)  # whose derivatives have to be those at the best point
        try:
            return _solved(exchange, scheme, x, order, anchor=snapshot, **settings)
        finally:
            snapshot.close()

    allowed: Admissible | None = settings["admissible"]
    begin = now.predictor.at(exchange.end)
    begin = begin if allowed is None else allowed.clipped(begin, now.x)
    found = attempt(begin)
    events: list[Recovery] = list(found.recoveries)
    iterations = found.iterations
    same = found.refused and found.iterations == 1 and np.array_equal(begin, now.x)  # is not worth a second try
    if not found.converged and found.status != "terminated" and not same:
        events.append(Recovery(iterations, found.message.rstrip("."), "the step was restarted"))
        restart = getattr(scheme, "restart", None)
        if restart is not None:
            restart()
        now.predictor.forget()
        found = attempt(now.x)
        iterations += found.iterations
        events += found.recoveries
    status = "recovered" if found.converged and events else found.status
    _book(exchange, now, status, found, iterations, events)
    return status, found


def _explicit_step(exchange: Exchange, now: March, order: Order, recoveries: int) -> tuple[str, FixedPointResult]:
    """One exchange, repeated as it was if it fails and all participants can restore their states."""
    if exchange.without_rollback():
        recoveries = 0
    found = _solved(
        exchange,
        ConstantRelaxation(1.0),
        now.x,
        order,
        atol=ANY,
        max_iterations=recoveries + 1,
        recoveries=recoveries,
        fields=exchange.fields(order),
    )
    status = "recovered" if found.converged and found.recoveries else found.status
    _book(exchange, now, status, found, found.iterations, list(found.recoveries))
    return status, found


def _solved(exchange: Exchange, scheme: Scheme, x: np.ndarray, order: Order, **settings: Any) -> FixedPointResult:
    """The fixed point of the exchange from x; where nothing is sent back, one exchange is all there is to do."""
    if x.size:
        return fixed_point(lambda x: exchange.evaluate(x, order), x, scheme, **settings)

    def same(one: np.ndarray) -> np.ndarray:
        exchange.evaluate(x, order)
        return one

    limits = {key: settings[key] for key in ("max_iterations", "recoveries")}
    found = fixed_point(same, np.zeros(1), ConstantRelaxation(1.0), atol=ANY, **limits)
    return replace(found, x=x, x_tilde=x)


def _book(
    exchange: Exchange, now: March, status: str, found: FixedPointResult, iterations: int, events: list[Recovery]
) -> None:
    now.steps.append(exchange.end, status, iterations, float(found.residual_norms[-1]), len(events))
    for event in events:
        now.steps.messages.append((len(now.steps), str(event)))
    if status not in GOOD:
        now.steps.messages.append((len(now.steps), found.message))
