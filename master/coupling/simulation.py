"""A transient scene: the two participants coupled in time by what they have in common, and inputs over time."""

import contextlib
import csv
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from interface import StepFailed, irregular
from interface.variables import allowed, first_outside
from master.coupling.acceleration import Scheme
from master.coupling.convergence import required_count, required_number
from master.coupling.exchange import Connection, Exchange, Order
from master.coupling.fixed_point import FixedPointResult
from master.coupling.march import GOOD, March, MarchResult, Steps, march
from master.coupling.participants import Participant
from master.coupling.participants.blocks import Limits
from master.coupling.schemes import SCHEMES, scheme
from master.coupling.validity import Judgement, Peaks

# The flow first: serial, it sees the motion of the step before or, where steps are iterated, that of this one.
FLOW, STRUCTURE = "aero", "structural"
MOTION = ("displacement", "velocity")
PREDICTOR = "linear"
START_SCHEME = "iqn-ils"
NO_START = "no equilibrium of structure and flow was found to start from; the structure starts in its own"
ROUNDING = 1e-9  # part of a time by which it may miss that of a row of inputs
# Parameters of the schemes in transient scenes. The first update takes the whole change: where steps are short, inertia
# makes the coupling weak. Columns of more than one step before are those of another state of taut and slack lines, and
# mislead.
PARAMETERS: dict[str, dict[str, Any]] = {
    "relaxation": {"omega": 1.0},
    "aitken": {"omega": 1.0},
    "iqn-ils": {"omega0": 1.0, "reuse": 1},
    "iqn-imvj": {"omega0": 1.0},
}
Follower = Callable[[float, "Simulation"], object]
# Told after every communication step with all that a checkpoint needs; and what a run continues from, if anything.
Holder = Callable[[Exchange, Scheme | None, March], object]
Begun = Callable[[Exchange, Scheme | None], March]


@dataclass(frozen=True, eq=False)
class Inputs:
    """Columns of a table over `times` (k,) s: name of a block of either side -> values (k,), linear between the rows
    (switches and whole numbers: as in the row before) and held outside. A communication step gets the values at its
    end, to which tapes move in the course of it. `rows` (k,) are numbers of lines in the file, for messages.
    """

    path: str
    times: np.ndarray
    columns: dict[str, np.ndarray]
    rows: Sequence[int] = ()

    @classmethod
    def read(cls, path: Path) -> "Inputs":
        """The table of a file whose first column is `time`; ValueError naming file, row and remedy."""
        if what := irregular(path):
            raise ValueError(f"{path} is {what}; name a regular file.")
        try:
            with path.open(newline="", encoding="utf-8-sig") as file:
                rows = [(n, row) for n, row in enumerate(csv.reader(file), 1) if any(c.strip() for c in row)]
        except OSError as error:
            raise ValueError(f"{path} cannot be read ({(error.strerror or str(error)).lower()}).") from None
        except (csv.Error, UnicodeDecodeError) as error:
            raise ValueError(
                f"{path} is not a readable CSV file ({error}); save it as comma-separated UTF-8."
            ) from None
        header = [c.strip() for c in rows[0][1]] if rows else []
        if len(header) < 2 or header[0] != "time" or len(rows) < 2:
            raise ValueError(f"{path} must have a first row 'time,NAME,...' and at least one row of numbers; add them.")
        values = []
        for n, row in rows[1:]:
            if len(row) != len(header):
                raise ValueError(
                    f"{path} row {n} has {len(row)} cells where the header has {len(header)}; mend the row."
                )
            values.append([_number(path, n, name, cell) for name, cell in zip(header, row, strict=True)])
        table = np.array(values)
        back = np.flatnonzero(np.diff(table[:, 0]) <= 0.0)
        if len(back):
            raise ValueError(f"{path} row {rows[back[0] + 2][0]}: time does not increase; sort the rows by time.")
        if len(set(header)) < len(header):
            raise ValueError(f"{path} row 1 names a column twice; drop one.")
        columns = {name: table[:, k] for k, name in enumerate(header) if k > 0}
        return cls(str(path), table[:, 0], columns, [n for n, _ in rows[1:]])

    def require(self, participants: Mapping[str, Participant]) -> None:
        """ValueError in one sentence for a column that is no scalar parameter or input of either side, and for a value
        that one of them does not take, whenever it would come.
        """
        for name, values in self.columns.items():
            owners = [p for p in participants.values() if p.causality.get(name) in ("parameter", "input")]
            if not owners:
                known = sorted({b for p in participants.values() for b, c in p.causality.items()
                                if c in ("parameter", "input") and p.blocks[b] == ()})  # fmt: skip
                raise ValueError(f"{self.path} row 1: there is no '{name}'; there are: {', '.join(known)}.")
            if owners[0].blocks[name] != ():
                raise ValueError(f"{self.path} row 1: {name} is no single value; leave it out.")
            for limits in (p.limits[name] for p in owners if hasattr(p, "limits")):
                self._require_values(name, values, limits)

    def _require_values(self, name: str, values: np.ndarray, limits: Limits) -> None:
        if limits.variability == "fixed":
            raise ValueError(
                f"{self.path} row 1: {name} is fixed once a run has begun, so it is no column of inputs; set it at the "
                "start."
            )
        low, high = (None if b is None else float(b) for b in (limits.minimum, limits.maximum))
        k, wanted = first_outside(values, low, high), allowed(low, high)
        if k is None and limits.kind != "real":
            wrong = values != np.round(values)
            wrong |= (limits.kind == "boolean") & (np.abs(values - 0.5) > 0.5)
            k = int(np.argmax(wrong)) if wrong.any() else None
            wanted = "0 or 1" if limits.kind == "boolean" else "a whole number"
        if k is not None:
            row = f" row {self.rows[k]}" if len(self.rows) else ""
            raise ValueError(f"{self.path}{row}: {name} at {self.times[k]:g} s must be {wanted}, not {values[k]:g}.")

    def apply(self, participants: Mapping[str, Participant], time: float) -> None:
        """Set all columns to their values at a time s."""
        row = max(0, int(np.searchsorted(self.times, time + ROUNDING * max(1.0, abs(time)), "right")) - 1)
        for name, values in self.columns.items():
            # between the values of two rows whatever the rounding, so that none is out of bounds
            linear = np.clip(np.interp(time, self.times, values), values.min(), values.max())
            for participant in participants.values():
                if participant.causality.get(name) in ("parameter", "input"):
                    limits = getattr(participant, "limits", {}).get(name)
                    whole = limits is not None and limits.kind != "real"
                    participant.set(name, np.array(float(values[row] if whole else linear)))


@dataclass(eq=False)
class Simulation:
    """A run under way or at its end: `time` s reached, from the `start` s on; "status" and `message` as of
    `MarchResult`, the `steps`, evaluations of the coupled step, `seconds` of each participant, and present values:
    `blocks`.
    """

    participants: dict[str, Participant]
    time: float = 0.0
    start: float = 0.0
    status: str = "converged"
    message: str = ""
    steps: Steps = field(default_factory=Steps)
    evaluations: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    peaks: Peaks = field(init=False)

    def __post_init__(self) -> None:
        self.peaks = Peaks(self.participants)

    @property
    def validity(self) -> list[Judgement]:
        """The largest values at the end of any communication step, judged by what each side says of itself."""
        return self.peaks.found

    @property
    def finished(self) -> bool:
        """Whether every communication step converged."""
        return self.status in GOOD

    @property
    def blocks(self) -> dict[str, dict[str, np.ndarray]]:
        """Side -> block -> present values; none of a participant that has ended."""
        found: dict[str, dict[str, np.ndarray]] = {side: {} for side in self.participants}
        for side, p in self.participants.items():
            with contextlib.suppress(ValueError, RuntimeError):
                found[side] = {block: p.get(block) for block in p.blocks}
        return found


def equilibrium_is_asked_for(participants: Mapping[str, Participant]) -> bool:
    """Whether a structure in a flow is to start in equilibrium."""
    structure = participants[STRUCTURE]
    asked = FLOW in participants and "start_in_equilibrium" in structure.blocks
    return asked and bool(structure.get("start_in_equilibrium"))


def exchange_of(participants: Mapping[str, Participant], step: float) -> Exchange:
    """Both participants, connected by every output of one that is an input of the other, by name."""
    connections = [
        Connection(source, block, target, block)
        for source, a in participants.items()
        for target, b in participants.items()
        if source != target
        for block, causality in a.causality.items()
        if causality == "output" and b.causality.get(block) == "input"
    ]
    return Exchange(participants, connections, dt=step, rollback=True)


def tolerances(exchange: Exchange, order: Order, tolerance: float) -> dict[str, float]:
    """Of every field that is iterated: `tolerance` m for displacements, what changes by that within the communication
    step for velocities, and a millionth of the newtons per metre of tolerance for loads (parallel order only).
    """
    of = {"displacement": tolerance, "velocity": tolerance / exchange.dt}
    return {name: of.get(name.partition(".")[2], 1e6 * tolerance) for name in exchange.fields(order)}


def simulate(
    participants: Mapping[str, Participant],
    stop_time: float,
    step: float,
    scheme_name: str = "iqn-ils",
    order: Order = "serial",
    tolerance: float = 1e-6,
    max_iterations: int = 50,
    inputs: Inputs | None = None,
    follower: Follower | None = None,
    hold: Holder | None = None,
    begun: Begun | None = None,
    **parameters: Any,
) -> Simulation:
    """Step a moving structure and the flow around it from 0 to `stop_time` s in communication steps of `step` s.

    `participants` are {"aero": flow, "structural": structure}, or the structure alone. The scheme "explicit" steps each
    once; its loads act all through the step (the structure's loads_vary is set to 0). A first step that starts in
    equilibrium it iterates all the same, by START_SCHEME, where both sides can restore a state: without, the structure
    would be in equilibrium with the flow around another shape; where that fails, it is so, with a message. The others
    repeat every step until the motion changes by no more than `tolerance` m; `parameters` of the scheme go before
    PARAMETERS. `inputs` vary in time; `follower(time, simulation)` is called at the start and after every step.

    `hold(exchange, scheme, march)` follows every step with what a checkpoint needs; `begun(exchange, scheme)` restores
    the participants of a run, and gives what it continues from. ValueError in one sentence for bad input; a step that
    cannot be solved ends the run with its status.
    """
    _require(participants, stop_time, step, tolerance, max_iterations)
    run = Simulation({side: participants[side] for side in (FLOW, STRUCTURE) if side in participants})
    if inputs is not None:
        inputs.require(run.participants)
    exchange = exchange_of(run.participants, step)
    exchange.fields(order)
    made = _scheme(scheme_name, exchange, order, parameters)
    used = made if scheme_name != "explicit" and FLOW in run.participants else None
    now = None if begun is None else begun(exchange, used)
    run.time = run.start = exchange.time
    run.steps = Steps() if now is None else now.steps
    _begin(run, scheme_name, now is None)
    if inputs is not None:
        inputs.apply(run.participants, exchange.end)
    if follower is not None:
        follower(exchange.time, run)
    if now is None:
        now = replace(March.beginning(exchange, order, PREDICTOR), steps=run.steps)

    def accepted(time: float, found: FixedPointResult) -> None:
        run.time = time
        run.evaluations = exchange.evaluations
        with contextlib.suppress(ValueError, RuntimeError):  # of a participant that has ended: the run will say so
            run.peaks.take(time)
        try:
            if inputs is not None:
                inputs.apply(run.participants, exchange.end)
        except ValueError as error:  # what only the participant can judge
            raise StepFailed(f"inputs for {exchange.end:g} s: {str(error).rstrip('.')}") from error
        finally:
            if follower is not None:
                follower(time, run)

    def held(march: March) -> None:
        if hold is not None:
            hold(exchange, used, march)

    def marched(by: Scheme | None, end: float) -> MarchResult:
        atol = 1.0 if scheme_name == "explicit" and by is None else tolerances(exchange, order, tolerance)
        return march(
            exchange, by, end, order, atol=atol, rtol=0.0, predictor=PREDICTOR, max_iterations=max_iterations,
            callback=accepted, hold=held, begun=now,
        )  # fmt: skip

    first = None
    settles = used is None and not len(now.steps) and stop_time > exchange.time
    if settles and equilibrium_is_asked_for(run.participants) and not exchange.without_rollback():
        start = _scheme(START_SCHEME, exchange, order, {})
        first = _first_step(run, exchange, lambda: marched(start, exchange.end))
    ended = first is not None and (first.status not in GOOD or exchange.time > stop_time - 0.5 * step)
    result = first if ended and first is not None else marched(used, stop_time)
    run.time, run.status, run.message, run.steps = result.time, result.status, result.message, result.steps
    run.evaluations, run.seconds = result.evaluations, result.seconds
    return run


def _first_step(run: Simulation, exchange: Exchange, iterated: Callable[[], MarchResult]) -> MarchResult | None:
    """The first communication step of a run, iterated; None where that found no equilibrium, and the run stands at its
    beginning with a message.
    """
    result = iterated()
    if result.status in GOOD or exchange.time > run.start:
        return result
    if len(run.steps):
        run.steps.drop()
    run.steps.messages.append((1, NO_START))
    return None


def _require(
    participants: Mapping[str, Participant], stop_time: float, step: float, tolerance: float, max_iterations: int
) -> None:
    """ValueError in one sentence for participants, times or tolerances that make no sense."""
    known = f'"{STRUCTURE}", and "{FLOW}" where there is a flow'
    if STRUCTURE not in participants:
        raise ValueError(f"there is no participant '{STRUCTURE}'; simulate takes {known}.")
    if unknown := [side for side in participants if side not in (STRUCTURE, FLOW)]:
        raise ValueError(f"there is no place for a participant '{unknown[0]}'; simulate takes {known}.")
    required_number("stop_time", stop_time, least=0.0)
    required_number("step", step)
    required_number("tolerance", tolerance)
    required_count("max_iterations", max_iterations)


def _scheme(name: str, exchange: Exchange, order: Order, parameters: dict[str, Any]) -> Scheme:
    if name in SCHEMES and SCHEMES[name].exact:
        raise ValueError(
            f"scheme {name} takes derivatives of quasi-static solves; choose another for a transient scene."
        )
    return scheme(name, exchange, order, **(PARAMETERS.get(name, {}) | parameters))


def _begin(run: Simulation, scheme_name: str, at_start: bool) -> None:
    """Let loads act as the scheme needs it and, at the start, the flow know where the structure is."""
    structure, flow = run.participants[STRUCTURE], run.participants.get(FLOW)
    if "loads_vary" in structure.blocks:
        structure.set("loads_vary", np.array(0.0 if scheme_name == "explicit" else 1.0))
    for block in MOTION:
        if at_start and flow is not None and flow.causality.get(block) == "input" and block in structure.blocks:
            flow.set(block, structure.get(block))


def _number(path: Path, row: int, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{path} row {row}: {name} '{cell.strip()}' is not a finite number; correct the cell.")
    return value
