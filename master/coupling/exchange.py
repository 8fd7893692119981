"""Participants and the connections between them, as one map of what they send back.

Serial (Gauss-Seidel): the participants step in their order, each with what those before it have just sent; unknown is
only what is sent back to an earlier one. Parallel (Jacobi): all step with what was sent before; everything that is sent
is unknown.
"""

import contextlib
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from interface import StepFailed
from master.coupling.admissible import Admissible
from master.coupling.participants import Participant, SimulationEnded

Order = Literal["serial", "parallel"]
ORDERS: tuple[Order, ...] = get_args(Order)
Interpolation = Literal["linear", "constant"]


CoupledStepFailed = StepFailed  # its name in releases up to 0.1


@dataclass(frozen=True)
class Connection:
    """`factor` times the block `output` of participant `source`, plus `offset`, is the block `input` of `target`.

    Both are numbers, or arrays of the shape of the block.
    """

    source: str
    output: str
    target: str
    input: str
    factor: Any = 1.0
    offset: Any = 0.0
    table: tuple[tuple[float, float], ...] = ()  # (sent, arriving) of discrete values, in place of the two

    @property
    def field(self) -> str:
        """Name of what is sent."""
        return f"{self.source}.{self.output}"

    def __str__(self) -> str:
        return f"{self.source}.{self.output} -> {self.target}.{self.input}"

    def applied(self, values: np.ndarray) -> np.ndarray:
        """What arrives when `values` are sent; ValueError for one that the table does not have."""
        if self.table:
            return self._looked_up(values)
        arriving = self.applied_change(values)
        return arriving if _is(self.offset, 0.0) else arriving + self.offset

    def sent(self, arriving: np.ndarray) -> np.ndarray:
        """What has to be sent for `arriving` to arrive; nan for what the table does not have."""
        if self.table:
            known = {arrives: sent for sent, arrives in reversed(self.table)}
            flat = np.ravel(np.asarray(arriving, dtype=float)).tolist()
            return np.reshape([known.get(value, np.nan) for value in flat], np.shape(arriving))
        return (arriving - self.offset) / self.factor

    def sent_bounds(self, low: Any, high: Any, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Between which values what is sent has to be, for what arrives to be within bounds (None: unbounded),
        (entries,) each.
        """
        if self.table:
            return np.full(int(np.prod(shape)), -np.inf), np.full(int(np.prod(shape)), np.inf)
        ends = (-np.inf if low is None else low, np.inf if high is None else high)
        a, b = (np.ravel(self.sent(np.broadcast_to(np.asarray(end, dtype=float), shape))) for end in ends)
        return np.minimum(a, b), np.maximum(a, b)

    def _looked_up(self, values: np.ndarray) -> np.ndarray:
        known, sent = dict(self.table), np.asarray(values, dtype=float)
        for value in np.ravel(sent).tolist():
            if value not in known:
                raise ValueError(f"{self.field} is {value:g}, which the map of connection {self} does not have")
        return np.reshape([known[value] for value in np.ravel(sent).tolist()], sent.shape)

    def applied_change(self, changes: np.ndarray) -> np.ndarray:
        """By how much what arrives changes when what is sent does by `changes`."""
        return changes if _is(self.factor, 1.0) else self.factor * changes


def _is(value: Any, number: float) -> bool:
    return not isinstance(value, np.ndarray) and value == number


class Exchange:
    """The coupled map of participants: what they send back, given what was sent back before.

    `substeps` (participant -> number) divides a communication step; the inputs of substep j of m then go linearly from
    their values at the beginning of the communication step to the new ones, or are the new ones (`interpolation`).
    With `rollback` an evaluation begins at the states saved by `open`, so that a communication step can be repeated;
    without it time advances with every evaluation, as in quasi-static scenes. `evaluations` counts evaluations,
    `products` directional derivatives of participants, `seconds` what each participant took. `clock` is when steps of
    this size began, s, and how many there were since: times counted so do not drift with the rounding of many sums. No
    step reaches beyond the `stop` time that participants were told, not even by rounding. Whole numbers are never
    interpolated. `remarks` are sentences about what was put right, `received` what each participant was sent last.
    """

    def __init__(
        self,
        participants: Mapping[str, Participant],
        connections: Sequence[Connection],
        dt: float = 1.0,
        time: float = 0.0,
        substeps: Mapping[str, int] | None = None,
        interpolation: Interpolation = "linear",
        rollback: bool = False,
        memoryless: Sequence[str] = (),
        stop: float | None = None,
    ) -> None:
        self.participants = dict(participants)
        self.connections = list(connections)
        self.dt, self.clock = float(dt), (float(time), 0)
        self.substeps = dict.fromkeys(self.participants, 1) | dict(substeps or {})
        self.interpolation: Interpolation = interpolation
        self.rollback = rollback
        self.memoryless = frozenset(memoryless)
        self.evaluations = 0
        self.products = 0
        self.seconds = dict.fromkeys(self.participants, 0.0)
        self.stop = stop
        self.remarks: list[str] = []
        self.received: dict[str, list[np.ndarray]] = {}
        self._states: dict[str, Any] = {}
        self._began: dict[str, np.ndarray] = {}  # what each input was at the beginning of the window
        self._check()
        place = {name: k for k, name in enumerate(self.participants)}
        self._inputs: dict[str, list[tuple[Connection, str]]] = {n: [] for n in self.participants}
        self._outputs: dict[str, dict[str, str]] = {n: {} for n in self.participants}  # of each: field -> block
        self._sources: dict[str, tuple[str, str]] = {}  # field -> participant, block
        back = set()
        for c in self.connections:
            field = c.field
            self._inputs[c.target].append((c, field))
            self._outputs[c.source][field] = c.output
            self._sources[field] = c.source, c.output
            if place[c.source] >= place[c.target]:
                back.add(field)
        self._set = {n: getattr(p, "receive", getattr(p, "set", None)) for n, p in self.participants.items()}
        self._fields: dict[str, dict[str, slice]] = {"serial": {}, "parallel": {}}
        for order, fields in self._fields.items():
            at = 0
            for field, (source, output) in self._sources.items():
                if order == "parallel" or field in back:
                    size = math.prod(self.participants[source].blocks[output])
                    fields[field] = slice(at, at + size)
                    at += size

    def _check(self) -> None:
        known = ", ".join(self.participants)
        for name in (*self.substeps, *self.memoryless):
            if name not in self.participants:
                raise ValueError(f"there is no participant '{name}'; there are: {known}.")
        for name, count in self.substeps.items():
            if not (np.isfinite(count) and int(count) == count and count >= 1):
                raise ValueError(f"participant {name} must make a whole number of substeps >= 1, not {count}.")
        if not (np.isfinite(self.dt) and self.dt > 0.0):
            raise ValueError(f"the communication step must be above zero, not {self.dt:g} s.")
        if self.interpolation not in ("linear", "constant"):
            raise ValueError(f"inputs are interpolated linear or constant, not '{self.interpolation}'.")
        taken: dict[tuple[str, str], Connection] = {}
        of = {name: participant.causality for name, participant in self.participants.items()}
        for c in self.connections:
            for role, block, causality in ((c.source, c.output, "output"), (c.target, c.input, "input")):
                if role not in self.participants:
                    raise ValueError(f"connection {c}: there is no participant '{role}'; there are: {known}.")
                causalities = of[role]
                if causalities.get(block) != causality:
                    has = ", ".join(b for b, k in causalities.items() if k == causality) or "none"
                    raise ValueError(f"connection {c}: {role} has no {causality} '{block}'; it has: {has}.")
            sent, wanted = self._shape(c), self.participants[c.target].blocks[c.input]
            if sent != wanted:
                raise ValueError(f"connection {c}: {c.field} has shape {sent}, but {c.target}.{c.input} {wanted}.")
            if (c.target, c.input) in taken:
                raise ValueError(
                    f"connection {c}: {c.target}.{c.input} has a source already, {taken[c.target, c.input]}."
                )
            taken[c.target, c.input] = c
        if not self.connections and len(self.participants) > 1:
            raise ValueError("there are no connections; name at least one.")

    def _shape(self, c: Connection) -> tuple[int, ...]:
        return tuple(self.participants[c.source].blocks[c.output])

    @property
    def time(self) -> float:
        """Where the communication step under way begins, s."""
        begin, count = self.clock
        return begin + count * self.dt

    @property
    def end(self) -> float:
        """Where the communication step under way ends, s."""
        begin, count = self.clock
        return begin + (count + 1) * self.dt

    def _tick(self) -> None:
        begin, count = self.clock
        self.clock = begin, count + 1

    def fields(self, order: Order = "serial") -> dict[str, slice]:
        """Name of each unknown, participant.block, -> its entries in x."""
        return dict(self._of(order))

    def _of(self, order: str) -> dict[str, slice]:
        if order not in self._fields:
            raise ValueError(f"there is no order '{order}'; choose one of: {', '.join(ORDERS)}.")
        return self._fields[order]

    def present(self, order: Order = "serial") -> np.ndarray:
        """What the participants send back now, (unknowns,).

        Some FMUs have no outputs before their first step: where one is not finite, or no item of an enumeration, the
        value that it stands for is that of the input it goes to, and a remark says so. StepFailed where that is not
        finite either.
        """
        fields = self._of(order)
        x = self._collected(fields, {})
        for c in self.connections if self.evaluations == 0 else ():
            part = fields.get(c.field)
            if part is None or not self._itemless(c, x[part]):
                continue
            x[part] = self._expected(c.field, "no item of its enumeration")
        if not np.isfinite(x).all():
            for field, part in fields.items():
                if not np.isfinite(x[part]).all():
                    x[part] = np.where(np.isfinite(x[part]), x[part], self._expected(field))
        return x

    def _itemless(self, c: Connection, sent: np.ndarray) -> bool:
        """Whether a source sends what is no item of the enumeration that it is of."""
        limits = getattr(self.participants[c.source], "limits", {}).get(c.output)
        return limits is not None and bool(limits.items) and limits.foreign(sent) is not None

    def _expected(self, field: str, lacks: str = "not finite") -> np.ndarray:
        """What a source should send such that its first target has the input that it has now, (entries,)."""
        name, output = self._sources[field]
        connection = next(c for c in self.connections if c.field == field)
        with self.booked(connection.target, f"could not give {connection.input}"):
            values = np.ravel(connection.sent(self.participants[connection.target].get(connection.input)))
        if not np.isfinite(values).all():
            raise StepFailed(
                f"{self.described(name)} has {output} = nan before the first step, and {connection.target}."
                f"{connection.input}, which it goes to, is not finite either; give that a start value"
            )
        remark = (
            f"{field} is {lacks} before the first step; the start value of {connection.target}.{connection.input} "
            "stands in for it."
        )
        if remark not in self.remarks:
            self.remarks.append(remark)
        return values

    def source(self, field: str) -> tuple[str, str]:
        """The participant that sends an unknown, and the block that it is."""
        return self._sources[field]

    def admissible(self, order: Order = "serial") -> Admissible | None:
        """Which entries of x are whole numbers, and between which bounds the inputs take them; None without either."""
        fields = self._of(order)
        size = sum(f.stop - f.start for f in fields.values())
        whole = np.zeros(size, dtype=bool)
        low, high = np.full(size, -np.inf), np.full(size, np.inf)
        for c in self.connections:
            part = fields.get(c.field)
            if part is None:
                continue
            whole[part] |= self.discrete(c)
            limits = getattr(self.participants[c.target], "limits", {}).get(c.input)
            if limits is not None and not (limits.minimum is None and limits.maximum is None):
                ends = c.sent_bounds(limits.minimum, limits.maximum, self._shape(c))
                low[part], high[part] = np.maximum(low[part], ends[0]), np.minimum(high[part], ends[1])
        free = low > high  # inputs that contradict each other
        low[free], high[free] = -np.inf, np.inf
        found = Admissible(whole, low, high)
        return found if found.restricts else None

    def discrete(self, c: Connection) -> bool:
        """Whether a connection passes on whole numbers: truth values, counts, items of an enumeration."""
        ends = ((c.source, c.output), (c.target, c.input))
        limits = (getattr(self.participants[name], "limits", {}).get(block) for name, block in ends)
        return any(one is not None and one.kind != "real" for one in limits)

    def evaluate(self, x: np.ndarray, order: Order = "serial") -> np.ndarray:
        """One communication step of all participants with x (unknowns,): what they send back then.

        StepFailed, with the participant and its reason, if one refuses or raises anything.
        """
        fields = self._of(order)
        self.evaluations += 1
        if self.rollback:
            self.rewind()
        sent: dict[str, np.ndarray] = {}
        newest = sent if order == "serial" else {}  # what is sent back too goes on to later ones as it is by now
        for name, participant in self.participants.items():
            shapes = participant.blocks
            inputs = []
            for c, field in self._inputs[name]:
                known = newest.get(field)
                if known is None:
                    known = x[fields[field]].reshape(shapes[c.input]) if field in fields else sent[field]
                if c.table:
                    with self.booked(name, "got no input"):
                        inputs.append((c, c.applied(known)))
                else:
                    inputs.append((c, c.applied(known)))
            self.received[name] = [values for _, values in inputs]
            with self.booked(name):
                self._step(participant, name, inputs)
                for field, output in self._outputs[name].items():
                    sent[field] = participant.get(output)
        if not self.rollback:
            self._tick()
        return self._collected(fields, sent)

    def derivative(self, v: np.ndarray, order: Order = "serial") -> np.ndarray:
        """G' v at the states of the last evaluation, from the directional derivatives of the participants, (unknowns,).

        ValueError in one sentence for a participant that offers none.
        """
        fields = self._of(order)
        self.require_derivatives()
        sent: dict[str, np.ndarray] = {}
        for name, participant in self.participants.items():
            changes = {}
            for c, f in self._inputs[name]:
                new = f in sent and (order == "serial" or f not in fields)
                changes[c.input] = c.applied_change(sent[f] if new else v[fields[f]].reshape(self._shape(c)))
            with self.booked(name, "gave no derivative"):
                answers = participant.directional_derivative(changes)  # type: ignore[attr-defined]
            self.products += 1
            sent |= {c.field: answers[c.output] for c in self.connections if c.source == name}
        return self._collected(fields, sent)

    def require_derivatives(self) -> None:
        """ValueError in one sentence if a participant offers no directional derivatives."""
        for name, participant in self.participants.items():
            if not getattr(participant, "offers_derivatives", False):
                why = (
                    getattr(participant, "refuses_derivatives", "") or "use solvers in this process, or another scheme."
                )
                raise ValueError(f"{self.described(name)} offers no directional derivatives: {why}")

    def _step(self, participant: Participant, name: str, inputs: list[tuple[Connection, np.ndarray]]) -> None:
        count, put = int(self.substeps[name]), self._set[name] or participant.set
        for j in range(count):
            for c, new in inputs:
                old = self._began.get(str(c)) if count > 1 and self.interpolation == "linear" else None
                values = new if old is None else old + (j + 1) / count * (new - old)
                try:
                    put(c.input, values)
                except ValueError as error:
                    raise self._not_taken(c, values, error) from error
            t = self.time + self.dt * j / count
            participant.step(t, self._within(t, self.dt / count))

    def _not_taken(self, c: Connection, values: np.ndarray, error: ValueError) -> ValueError:
        """Why an input does not take what a source sends: the source is named of what is not finite or of no kind."""
        flat = np.ravel(values)
        if np.isfinite(flat).all():
            limits = getattr(self.participants[c.target], "limits", {}).get(c.input)
            bad = None if limits is None or limits.kind == "real" else limits.foreign(flat)
        else:
            bad = flat[~np.isfinite(flat)][0]
        if bad is None:
            return error
        return ValueError(f"{str(error).rstrip('.')} ({self.described(c.source)} sent {c.output} = {bad:g})")

    def _within(self, t: float, dt: float) -> float:
        """The step from t, s, that does not reach beyond the stop time by rounding."""
        if self.stop is None or t + dt <= self.stop or t + 0.5 * dt > self.stop:
            return dt
        dt = self.stop - t
        while t + dt > self.stop:
            dt = float(np.nextafter(dt, 0.0))
        return dt

    def _collected(self, fields: Mapping[str, slice], sent: Mapping[str, np.ndarray]) -> np.ndarray:
        x = np.empty(sum(f.stop - f.start for f in fields.values()))
        for field, f in fields.items():
            if field in sent:
                x[f] = sent[field].reshape(-1)
            else:
                name, output = self._sources[field]
                x[f] = np.ravel(self.participants[name].get(output))
        return x

    @contextlib.contextmanager
    def booked(self, name: str, failed: str = "refused a step") -> Iterator[None]:
        """Book the time of a participant; whatever it raises ends the coupled evaluation."""
        start = time.perf_counter()
        try:
            yield
        except Exception as error:
            plain = isinstance(error, StepFailed | ValueError | RuntimeError) and str(error)
            reason = str(error).rstrip(".") if plain else f"{type(error).__name__}: {error}".rstrip(".: ")
            kind = type(error) if isinstance(error, StepFailed) else StepFailed
            told = "" if isinstance(error, SimulationEnded) else f" {failed}:"
            raise kind(f"{self.described(name)}{told} {' '.join(reason.split())}") from error
        finally:
            self.seconds[name] += time.perf_counter() - start

    def described(self, name: str) -> str:
        """What messages call a participant."""
        return f"participant {name}"

    def fixed(self) -> set[str]:
        """Parameters of the participants that take a value only before the first step."""
        limits = (getattr(p, "limits", {}) for p in self.participants.values())
        return {name for each in limits for name, one in each.items() if one.variability == "fixed"}

    def without_rollback(self) -> list[str]:
        """The participants with a memory that cannot restore their state to repeat a communication step."""
        return [
            name
            for name, participant in self.participants.items()
            if name not in self.memoryless and not getattr(participant, "saves_state", True)
        ]

    def require_rollback(self) -> None:
        """ValueError in one sentence if a communication step cannot be repeated."""
        for name in self.without_rollback():
            raise ValueError(
                f"{self.described(name)} cannot save and restore its state (canGetAndSetFMUstate is false), so a "
                "communication step cannot be repeated: use the explicit scheme, or declare the participant memoryless "
                "if its outputs depend on its present inputs and the time only."
            )

    # States: of the beginning of a communication step (`open`, `rewind`, `accept`), or all (`save`, `restore`, `free`)

    def saving(self) -> set[str]:
        """The participants that can save their state."""
        return {n for n, p in self.participants.items() if getattr(p, "saves_state", True)}

    def save(self, needed: bool = False) -> dict[str, Any]:
        """The states of all participants that can save one; only those with a memory if no other is `needed`."""
        states: dict[str, Any] = {}
        saving = self.saving() - (self.memoryless if needed else set())
        try:
            for name in self.participants:
                if name in saving:
                    with self.booked(name, "could not save its state"):
                        states[name] = self.participants[name].save()
        except BaseException:
            self.free(states)
            raise
        return states

    def restore(self, states: Mapping[str, Any]) -> None:
        """Restore the `states` of participants; StepFailed if one cannot."""
        for name, state in states.items():
            with self.booked(name, "could not restore its state"):
                self.participants[name].restore(state)

    def free(self, states: dict[str, Any]) -> None:
        """Free what `states` hold; a participant that has ended holds nothing any more."""
        while states:
            name, state = states.popitem()
            with contextlib.suppress(ValueError, RuntimeError):
                self.participants[name].free(state)

    def open(self, order: Order = "serial", once: bool = False) -> None:
        """Begin a communication step: from here evaluations start, and inputs go from what is sent now.

        No state is saved where there is to be one evaluation `once` and for all.
        """
        self.free(self._states)
        self._states = self.save(needed=True) if self.rollback and not once else {}
        self._began = {}
        for name, count in self.substeps.items():
            for c, _ in self._inputs[name] if count > 1 else ():
                begin = c.applied(self.participants[c.source].get(c.output)).copy()
                if np.isfinite(begin).all() and not self.discrete(c):
                    self._began[str(c)] = begin

    def rewind(self) -> None:
        """Return to the beginning of the communication step."""
        self.restore(self._states)

    def accept(self) -> None:
        """End a communication step: time advances, the states of its beginning are freed."""
        self.abandon()
        if self.rollback:
            self._tick()

    def abandon(self) -> None:
        """Free the states of the beginning of the communication step; the participants stay as they are."""
        self.free(self._states)
        self._began = {}


class StateSnapshot:
    """Anchor of a coupling loop (see `fixed_point`): the states of the participants at the best point so far, and their
    clock.
    """

    def __init__(self, exchange: Exchange, best: tuple[dict[str, Any], tuple[float, int]] | None = None) -> None:
        self._exchange = exchange
        self.states, self.clock = (exchange.save(), exchange.clock) if best is None else best

    def mark(self) -> None:
        """See Anchor."""
        self._exchange.free(self.states)
        self.states, self.clock = self._exchange.save(), self._exchange.clock

    def restore(self) -> None:
        """See Anchor."""
        self._exchange.restore(self.states)
        self._exchange.clock = self.clock

    def close(self) -> None:
        """Free the states."""
        self._exchange.free(self.states)
