"""How exactly unknowns can be known: below the rounding of what they are made of a residual says nothing."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from master.coupling.acceleration import Field
from master.coupling.convergence import IDLE, ROUNDING, ConvergenceMonitor
from master.coupling.exchange import Exchange

SINGLE = 8.0 * float(np.finfo(np.float32).eps)  # as ROUNDING, of single precision
BELOW_SINGLE = np.int64(2**29 - 1)  # the bits of a double that single precision does not have
ENOUGH = 8  # different values without these bits that let a field count as one of single precision


@dataclass
class Rounding:
    """What a run has shown of the rounding of each field.

    `largest` is its largest norm so far: where a difference of large numbers becomes small, their rounding stays.
    `double`: some value of it was none of single precision; `changes` counts different values, `single` are fields
    whose residual stopped falling at the rounding of single precision. `noise` is the largest residual norm that proved
    to be rounding of inputs; `last` (n,) what was sent last.
    """

    largest: np.ndarray = field(default_factory=lambda: np.zeros(0))
    noise: np.ndarray = field(default_factory=lambda: np.zeros(0))
    double: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    single: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    changes: np.ndarray = field(default_factory=lambda: np.zeros(0))
    last: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def begin(self, fields: int, entries: int) -> None:
        """Make room for the fields of a run; what was learnt stays."""
        if self.largest.size != fields or self.last.size != entries:
            self.largest, self.noise, self.changes = np.zeros(fields), np.zeros(fields), np.zeros(fields)
            self.double, self.single = np.zeros(fields, dtype=bool), np.zeros(fields, dtype=bool)
            self.last = np.full(entries, np.nan)

    @property
    def coarse(self) -> np.ndarray:
        """Which fields have had no value but of single precision, and enough of them, (fields,)."""
        return ~self.double & (self.changes >= ENOUGH)

    def floors(self) -> np.ndarray:
        """The residual norm of each field below which nothing is left to gain, (fields,)."""
        return np.maximum(np.where(self.single & ~self.double, SINGLE, ROUNDING) * self.largest, self.noise)


class ExchangeFloors:
    """Floors of a fixed point of an exchange (see `fixed_point`), which `rounding` keeps from step to step.

    Where a residual does not fall any more, it may be the rounding of single precision, if that is all that the field
    has; or that of the inputs of the participant that sends it: it is compared with the change of the field for the
    relative change of these inputs, times their rounding.
    """

    def __init__(self, rounding: Rounding, exchange: Exchange) -> None:
        self.rounding, self.exchange = rounding, exchange
        self._field_of = np.zeros(0, dtype=int)
        self._names: list[str] = []
        self._inputs: dict[str, list[np.ndarray]] = {}
        self._steep: list[np.ndarray] = []
        self._begun = rounding.largest.copy()

    def begin(self, names: list[str], parts: Sequence[Field]) -> None:
        """See Floors."""
        sizes = [part.stop - part.start if isinstance(part, slice) else int(np.size(part)) for part in parts]
        self._names, self._field_of = names, np.empty(sum(sizes), dtype=int)
        for k, part in enumerate(parts):
            self._field_of[part] = k
        self.rounding.begin(len(parts), sum(sizes))
        self._inputs, self._steep = {}, []
        self._begun = self.rounding.largest.copy()

    def forget(self) -> None:
        """See Floors."""
        self.rounding.largest = self._begun.copy()
        self._inputs, self._steep = {}, []

    def observe(self, x_tilde: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """See Floors."""
        own = self.rounding
        step = np.abs(x_tilde - own.last)
        if not own.double.all():
            bits = np.ascontiguousarray(x_tilde).view(np.int64)
            beyond, other = (bits & BELOW_SINGLE) != 0, x_tilde != own.last
            own.double = own.double | (self._summed(beyond) > 0.0)
            own.changes = own.changes + self._summed(other)
        own.largest = np.maximum(own.largest, sizes)
        own.last = x_tilde.copy()
        if self._inputs:
            self._steep = [*self._steep[1 - IDLE :], self._steepness(step)]
        self._inputs = dict(self.exchange.received)
        return own.floors()

    def _steepness(self, step: np.ndarray) -> np.ndarray:
        """How much each field has changed for the relative change of what its participant received, (fields,)."""
        moved = {name: _relative(self._inputs[name], now) for name, now in self.exchange.received.items()}
        change = np.array([moved[self.exchange.source(name)[0]] for name in self._names])
        with np.errstate(over="ignore"):
            size = np.sqrt(self._summed(step**2))
        return np.divide(size, change, out=np.zeros_like(size), where=change > 0.0)

    def _summed(self, values: np.ndarray) -> np.ndarray:
        """The sum of values (entries,) in each field, (fields,)."""
        return np.bincount(self._field_of, values, minlength=len(self._names))

    def explains(self, monitor: ConvergenceMonitor) -> bool:
        """See Floors."""
        if len(self._steep) < IDLE:
            return False
        own = self.rounding
        coarse = own.coarse
        bound = (SINGLE if coarse.any() else ROUNDING) * np.max(np.array(self._steep), axis=0)
        bound = np.maximum(bound, np.where(coarse, SINGLE * own.largest, 0.0))
        above = monitor.last > monitor.tolerance
        if not np.all(monitor.last[above] <= bound[above]):
            return False
        own.single = own.single | (coarse & above)
        own.noise = np.where(above, np.maximum(own.noise, monitor.last), own.noise)
        return True


def _relative(before: list[np.ndarray], now: list[np.ndarray]) -> float:
    """The largest change of inputs relative to their size."""
    largest = 0.0
    for a, b in zip(before, now, strict=True):
        size = float(np.linalg.norm(b))
        if size > 0.0:
            largest = max(largest, float(np.linalg.norm(np.asarray(b) - a)) / size)
    return largest
