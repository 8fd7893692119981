"""Convergence monitor: when a fixed point counts as found, and whether the iteration still makes progress."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from master.coupling.acceleration import Field

Tolerance = float | Mapping[str, float] | Sequence[float]

ROUNDING = 8.0 * np.finfo(float).eps  # a residual below this fraction of x_tilde is zero in double precision
# What lies beyond the data: unknowns that only updates made large are an answer where the residual has fallen by more
# than they have grown, by FALLEN, or is rounding of unknowns whose rounding is this small a part of all residuals.
FALLEN, NOISE = 0.1, 1e-3
ANY = 1e300  # tolerance of the explicit scheme: one exchange is enough, whatever it leaves
IDLE = 5  # evaluations without progress after which a residual may be noise
BLOWN = 1e6  # growth beyond the data at which tolerances that hold, and mean nothing, end the loop


def required_number(name: str, value: Any, least: float | None = None, infinite: bool = False) -> float:
    """A finite number above zero (or at least `least`) as it is; ValueError in one sentence for anything else."""
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool | np.bool_)
    fits = number and (value > 0.0 if least is None else value >= least) and (infinite or np.isfinite(value))
    if not fits:
        wanted = "above zero" if least is None else f"of at least {least:g}"
        raise ValueError(f"{name} must be a number {wanted}, not {value!r}.")
    return float(value)


def required_count(name: str, value: Any, least: int = 1) -> int:
    """A whole number of at least `least` as it is; ValueError in one sentence for anything else."""
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool | np.bool_)
    if not (number and np.isfinite(value) and int(value) == value and value >= least):
        raise ValueError(f"{name} must be a whole number of at least {least}, not {value!r}.")
    return int(value)


class ConvergenceMonitor:
    """Convergence criterion and progress measure of a coupling loop, with the first residuals and the best measure."""

    exact: np.ndarray | None = None  # fields of whole numbers: no residual of theirs is tolerated, whatever the norms
    floors: np.ndarray | None = None  # residual norms that are rounding of what the fields are made of
    tolerance = np.zeros(0)  # of the last evaluation
    last = np.zeros(0)  # residual norms of the last evaluation

    def __init__(
        self,
        names: list[str],
        atol: Tolerance,
        rtol: Tolerance,
        residual_rtol: Tolerance,
        exact: Sequence[str] = (),
    ):
        self.names = names
        self.atol, self.rtol = per_field("atol", atol, names, exact), per_field("rtol", rtol, names, exact)
        self.residual_rtol = per_field("residual_rtol", residual_rtol, names, exact)
        if exact:
            self.exact = np.array([name in exact for name in names])
        for name, *given in zip(names, self.atol, self.rtol, self.residual_rtol, strict=True):
            if not any(given) and name not in exact:
                raise ValueError(f"All tolerances of field '{name}' are zero; set atol, rtol or residual_rtol.")
        self.reference = np.zeros(len(names))  # |r_1| of each field
        self.scale = np.zeros(len(names))  # first tolerance of each field that is not zero
        self.data = np.zeros(len(names))  # size of each field that the data give: its first x_tilde, largest residual
        self.largest = np.zeros(len(names))  # |r_k| of each field
        self.converged = False
        self.blown = 0.0
        self.first = 0.0
        self.best = math.inf
        self.progressed_at = 0
        self.history: list[float] = []

    def measure(self, r: np.ndarray, size: np.ndarray) -> float:
        """max |r_f| / tolerance_f of this evaluation, from the norms of r and x_tilde of each field."""
        significant = r > ROUNDING * size
        self.reference = np.where((self.reference == 0.0) & significant, r, self.reference)
        tolerance = self.atol + self.rtol * size + self.residual_rtol * self.reference
        if self.floors is not None:
            tolerance = np.maximum(tolerance, self.floors)
        if self.exact is not None:
            tolerance = np.where(self.exact & (self.atol < ANY), 0.0, tolerance)
        self.tolerance, self.last = tolerance, r
        self._judge(r, size, significant, tolerance)
        self.scale = np.where(self.scale == 0.0, tolerance, self.scale)
        with np.errstate(over="ignore"):
            m = float(np.max(r / np.where(self.scale > 0.0, self.scale, np.inf), initial=0.0))
        if self.first == 0.0:
            self.first = m
        if m < 0.99 * self.best:
            self.best, self.progressed_at = m, len(self.history) + 1
        self.history.append(m)
        return m

    def _judge(self, r: np.ndarray, size: np.ndarray, significant: np.ndarray, tolerance: np.ndarray) -> None:
        """Set `converged`, and `blown`, the growth of an unknown beyond the data where that alone made tolerances hold.

        Tolerances that grow with the unknown, and its rounding, hold for any residual once updates have blown it up:
        of x = x + 1 they do at 1e16. With unknowns as large as the data nothing but the tolerances counts.
        """
        self.data = np.maximum(self.data, r if np.any(self.largest) else np.maximum(r, size))
        self.largest = np.maximum(self.largest, r)
        holds = (r <= tolerance) | ~significant
        tight = self.atol + self.rtol * np.minimum(size, self.data) + self.residual_rtol * self.reference
        if self.floors is not None:  # they grow with unknowns that updates have blown up
            within = np.divide(self.data, size, out=np.ones_like(size), where=size > self.data)
            tight = np.maximum(tight, within * self.floors)
        known = (size <= self.data) | (np.maximum(r, ROUNDING * size) <= tight)
        with np.errstate(over="ignore"):
            fallen = r * size <= FALLEN * self.largest * self.data
            noise = ~significant & (ROUNDING * size <= NOISE * self.largest)
        # the rounding of unknowns must leave something of the residuals, else a zero says nothing
        told = known | noise | (fallen & (ROUNDING * size <= FALLEN * self.largest))
        self.converged = bool(np.all(holds & told))
        growth = np.where(told, 0.0, size / np.where(self.data > 0.0, self.data, np.inf))
        self.blown = float(growth.max(initial=0.0)) if np.all(holds) else 0.0

    def worst(self) -> str:
        """The block that is farthest from its tolerance, its residual and that tolerance, and what helps."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            share = np.where(self.last > 0.0, self.last / self.tolerance, 0.0)
        k = int(np.argmax(share))
        of = f"{self.names[k]} has a residual of {self.last[k]:.3g}"
        if self.exact is not None and self.exact[k]:
            return (
                f"{of} and is passed on as it is, a whole number that has to repeat itself; use the explicit scheme, "
                "or a smaller step."
            )
        return f"{of}, its tolerance is {self.tolerance[k]:.3g}; raise atol or rtol if that residual is small enough."

    @property
    def improved(self) -> bool:
        """Whether the last measure is the smallest so far, by more than 1 %."""
        return self.progressed_at == len(self.history)

    @property
    def idle(self) -> int:
        """Evaluations since the smallest measure."""
        return len(self.history) - self.progressed_at

    def restart(self) -> None:
        """Do not count earlier evaluations as time without progress."""
        self.progressed_at = len(self.history)

    def renew(self) -> None:
        """The map has become another: what the residual was before is no measure."""
        self.first, self.best = 0.0, math.inf

    def stalled(self, window: int) -> bool:
        """Whether the smallest measure has not fallen within `window` evaluations, nor is m on its way down."""
        if len(self.history) - self.progressed_at <= window:
            return False
        h = self.history
        return all(min(h[-p:]) >= 0.9 * min(h[-2 * p : -p]) for p in (max(1, window // 6), max(1, window // 2)))

    def grows(self, window: int) -> bool:
        """Whether the median measure of the latest half of the window is more than three times that of the other."""
        half = max(1, window // 2)
        return bool(np.median(self.history[-half:]) > 3.0 * np.median(self.history[-2 * half : -half]))


def norm(a: np.ndarray) -> float:
    """|a|_2 without overflow or underflow of the squares; nan or inf where an entry is."""
    largest = float(np.max(np.abs(a), initial=0.0))
    return largest * float(np.linalg.norm(a / largest)) if 0.0 < largest < math.inf else largest


def field_norms(vectors: Sequence[np.ndarray], parts: Sequence[Field]) -> np.ndarray:
    """|a_f|_2 of each field of each vector, (fields, vectors)."""
    n = len(vectors[0])
    if len(parts) == n and all(isinstance(f, slice) and f.stop == k + 1 for k, f in enumerate(parts)):
        return np.abs(np.array(vectors)).T  # a field an entry
    return np.array([[norm(a[f]) for a in vectors] for f in parts]).reshape(-1, len(vectors))


def partition(fields: Mapping[str, Field] | None, n: int) -> tuple[list[str], list[Field]]:
    """Names and index sets of the fields; they must cover 0..n-1 exactly once."""
    if fields is None:
        return ["x"], [slice(None)]
    seen = np.zeros(n, dtype=int)
    for name, part in fields.items():
        try:
            entries = np.arange(n)[part]
        except IndexError as error:
            raise ValueError(f"Field '{name}' does not fit into x with {n} entries: {error}.") from error
        if np.size(entries) == 0:
            raise ValueError(f"Field '{name}' has no entries.")
        np.add.at(seen, entries, 1)
    if np.any(seen > 1):
        raise ValueError(f"Fields overlap: entry {int(np.argmax(seen > 1))} of x belongs to more than one.")
    if np.any(seen == 0):
        raise ValueError(f"Fields are incomplete: entry {int(np.argmax(seen == 0))} of x belongs to none.")
    return list(fields), [part if isinstance(part, slice) else np.arange(n)[part] for part in fields.values()]


def per_field(name: str, tolerance: Tolerance, names: list[str], exact: Sequence[str] = ()) -> np.ndarray:
    """One value for each field, finite and not negative; those of whole numbers (`exact`) need none."""
    if isinstance(tolerance, Mapping):
        if set(tolerance) - set(exact) != set(names) - set(exact):
            wanted = [field for field in names if field not in exact]
            raise ValueError(f"{name} must name every field once: {', '.join(wanted)}.")
        tolerance = [tolerance.get(field, 0.0) for field in names]
    values = np.array(tolerance, dtype=float)
    if values.ndim == 0:
        values = np.full(len(names), float(values))
    if values.shape != (len(names),):
        raise ValueError(f"{name} must be one number or one per field ({len(names)}).")
    if not np.all(np.isfinite(values)) or np.any(values < 0.0):
        raise ValueError(f"{name} must be finite and not negative.")
    return values
