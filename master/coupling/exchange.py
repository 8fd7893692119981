"""Participants and the connections between them, as one map of what they send back.

Serial (Gauss-Seidel): the participants step in their order, each with what those before it have just sent; unknown is
only what is sent back to an earlier one. Parallel (Jacobi): all step with what was sent before; everything that is sent
is unknown.
"""

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from interface import StepFailed
from master.coupling.participants import Participant

Order = Literal["serial", "parallel"]
ORDERS: tuple[Order, ...] = get_args(Order)
Interpolation = Literal["linear", "constant"]


CoupledStepFailed = StepFailed  # its name in releases up to 0.1


@dataclass(frozen=True)
class Connection:
    """`factor` times the block `output` of participant `source`, plus `offset`, is the block `input` of `target`."""

    source: str
    output: str
    target: str
    input: str
    factor: float = 1.0
    offset: float = 0.0
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
        return arriving if self.offset == 0.0 else arriving + self.offset

    def _looked_up(self, values: np.ndarray) -> np.ndarray:
        known, sent = dict(self.table), np.asarray(values, dtype=float)
        for value in np.ravel(sent).tolist():
            if value not in known:
                raise ValueError(f"{self.field} is {value:g}, which the map of connection {self} does not have")
        return np.reshape([known[value] for value in np.ravel(sent).tolist()], sent.shape)

    def applied_change(self, changes: np.ndarray) -> np.ndarray:
        """By how much what arrives changes when what is sent does by `changes`."""
        return changes if self.factor == 1.0 else self.factor * changes


class Exchange:
    """The coupled map of participants: what they send back, given what was sent back before.

    `substeps` (participant -> number) divides a communication step; the inputs of substep j of m then go linearly from
    their values at the beginning of the communication step to the new ones, or are the new ones (`interpolation`).
    With `rollback` an evaluation begins at the states saved by `open`, so that a communication step can be repeated;
    without it time advances with every evaluation, as in quasi-static scenes. `evaluations` counts evaluations,
    `products` directional derivatives of participants, `seconds` what each participant took. `clock` is when steps of
    this size began, s, and how many there were since: times counted so do not drift with the rounding of many sums.
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
        self._states: dict[str, Any] = {}
        self._began: dict[Connection, np.ndarray] = {}  # what each input was at the beginning of the window
        self._check()
        place = {name: k for k, name in enumerate(self.participants)}
        self._inputs = {n: [c for c in self.connections if c.target == n] for n in self.participants}
        back = {c.field for c in self.connections if place[c.source] >= place[c.target]}
        self._fields: dict[str, dict[str, slice]] = {"serial": {}, "parallel": {}}
        for order, fields in self._fields.items():
            at = 0
            for c in self.connections:
                if c.field not in fields and (order == "parallel" or c.field in back):
                    size = int(np.prod(self._shape(c)))
                    fields[c.field] = slice(at, at + size)
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
        for c in self.connections:
            for role, block, causality in ((c.source, c.output, "output"), (c.target, c.input, "input")):
                if role not in self.participants:
                    raise ValueError(f"connection {c}: there is no participant '{role}'; there are: {known}.")
                causalities = self.participants[role].causality
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
        """What the participants send back now, (unknowns,)."""
        return self._collected(self._of(order), {})

    def evaluate(self, x: np.ndarray, order: Order = "serial") -> np.ndarray:
        """One communication step of all participants with x (unknowns,): what they send back then.

        StepFailed, with the participant and its reason, if one refuses or raises anything.
        """
        fields = self._of(order)
        self.evaluations += 1
        if self.rollback:
            self.rewind()
        sent: dict[str, np.ndarray] = {}
        for name, participant in self.participants.items():
            inputs = {}
            for c in self._inputs[name]:
                known = x[fields[c.field]].reshape(self._shape(c)) if c.field in fields else sent[c.field]
                with self.booked(name, "got no input"):
                    inputs[c] = c.applied(known)
            with self.booked(name):
                self._step(participant, name, inputs)
                for field in {c.field: c for c in self.connections if c.source == name}.values():
                    sent[field.field] = participant.get(field.output)
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
            changes = {
                c.input: c.applied_change(
                    v[fields[c.field]].reshape(self._shape(c)) if c.field in fields else sent[c.field]
                )
                for c in self._inputs[name]
            }
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

    def _step(self, participant: Participant, name: str, inputs: dict[Connection, np.ndarray]) -> None:
        count = int(self.substeps[name])
        for j in range(count):
            for c, new in inputs.items():
                old = self._began.get(c)
                share = (j + 1) / count
                ramp = count > 1 and old is not None and self.interpolation == "linear"
                participant.set(c.input, old + share * (new - old) if ramp and old is not None else new)
            participant.step(self.time + self.dt * j / count, self.dt / count)

    def _collected(self, fields: Mapping[str, slice], sent: Mapping[str, np.ndarray]) -> np.ndarray:
        x = np.empty(sum(f.stop - f.start for f in fields.values()))
        outputs = {c.field: c for c in self.connections}
        for name, f in fields.items():
            c = outputs[name]
            values = sent[name] if name in sent else self.participants[c.source].get(c.output)
            x[f] = np.ravel(values)
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
            raise StepFailed(f"{self.described(name)} {failed}: {' '.join(reason.split())}") from error
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

    def save(self) -> dict[str, Any]:
        """The states of all participants that can save one."""
        states: dict[str, Any] = {}
        try:
            for name in self.participants:
                if name in self.saving():
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

    def open(self, order: Order = "serial") -> None:
        """Begin a communication step: from here evaluations start, and inputs go from what is sent now."""
        self.free(self._states)
        self._states = self.save() if self.rollback else {}
        ramps = [n for n, count in self.substeps.items() if count > 1]
        ramped = [c for n in ramps for c in self._inputs[n]]
        self._began = {c: c.applied(self.participants[c.source].get(c.output)).copy() for c in ramped}

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
