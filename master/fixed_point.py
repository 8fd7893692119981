"""The coupling loop: repeat x <- scheme(x, G(x) - x) until every field has converged, or say why not."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from master.acceleration import Field, Scheme

Status = Literal["converged", "max_iterations", "diverged", "stalled"]
Tolerance = float | Mapping[str, float] | Sequence[float]

ROUNDING = 8.0 * np.finfo(float).eps  # a residual below this fraction of x_tilde is zero in double precision


@dataclass(frozen=True, eq=False)
class FixedPointResult:
    """End of a coupling loop.

    `x` is the last point where G was evaluated, so that the tested residual `x_tilde - x` belongs to it; `x_tilde` =
    G(x) is normally the better point. Both have the shape and unit of x0. `iterations` counts evaluations of G;
    `residual_norms` (iterations,) holds |r|_2 over all entries, `field_residual_norms` the same of each field.
    """

    x: np.ndarray
    x_tilde: np.ndarray
    status: Status
    iterations: int
    residual_norms: np.ndarray
    field_residual_norms: dict[str, np.ndarray]
    message: str

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
) -> FixedPointResult:
    """Solve x = G(x) from x0 with an acceleration scheme.

    Converged means |r|_2 <= atol + rtol |x_tilde|_2 + residual_rtol |r_1|_2 in every field, with r = x_tilde - x. A
    tolerance is one number or one per field (mapping by name, or sequence in the order of `fields`). r_1 is the first
    residual of the field that is not zero to rounding; one that is zero to rounding has converged. `fields` maps names
    to slices or index arrays of the flattened x and covers it exactly once. `callback(k, x, x_tilde, r)` follows each
    evaluation.

    Progress is measured as m = max over the fields of |r_f| / tolerance_f (tolerances of the first evaluation).
    "diverged": m exceeds `growth_limit` times its first value, something is not finite, or G raises an ArithmeticError
    (FloatingPointError, OverflowError, ZeroDivisionError). "stalled": the smallest m so far has not fallen by 1 %
    within the last `stall_window` evaluations (0: never), nor is m on its way down from a transient: the smallest m
    of the latest half (or sixth) of the window is then 10 % below that of the half (sixth) before. Other exceptions
    of G pass through. Floating-point warnings in G are silent, because the outcome is checked. Bad arguments raise
    ValueError.
    """
    x = np.array(x0, dtype=float)
    shape = x.shape
    x = x.ravel()
    if not np.all(np.isfinite(x)) or x.size == 0:
        raise ValueError("x0 must have at least one entry and all its entries must be finite.")
    if isinstance(max_iterations, bool) or int(max_iterations) != max_iterations or max_iterations < 1:
        raise ValueError(f"max_iterations must be a whole number >= 1, got {max_iterations}.")
    if not growth_limit > 1.0 or stall_window < 0:
        raise ValueError("growth_limit must be above 1 and stall_window not negative.")
    names, parts = _partition(fields, x.size)
    test = _Test(
        names, *(_per_field(*t, names) for t in (("atol", atol), ("rtol", rtol), ("residual_rtol", residual_rtol)))
    )

    norms: list[float] = []
    field_norms: list[np.ndarray] = []
    status: Status = "max_iterations"
    message = f"Not converged within {max_iterations} evaluations of G."
    scheme.begin(parts)
    for k in range(1, int(max_iterations) + 1):
        x_tilde, failure = _evaluate(G, x.reshape(shape), k)
        with np.errstate(all="ignore"):
            r = x_tilde - x
            norm = _norm(r)
            r_f = np.array([_norm(r[f]) for f in parts])
            size_f = np.array([_norm(x_tilde[f]) for f in parts])
        norms.append(norm)
        field_norms.append(r_f)
        if callback is not None:
            callback(k, x.reshape(shape).copy(), x_tilde.reshape(shape).copy(), r.reshape(shape).copy())
        if failure or not (np.all(np.isfinite(r_f)) and np.all(np.isfinite(size_f))):
            status, message = "diverged", failure or f"G returned values that are not finite at evaluation {k}."
            break
        measure = test.measure(r_f, size_f)
        if test.converged:
            status, message = "converged", f"Converged in {k} evaluations of G."
            break
        if measure > growth_limit * test.first:
            status = "diverged"
            message = f"The residual grew to more than {growth_limit:g} times its first value in {k} evaluations of G."
            break
        if stall_window and test.stalled(int(stall_window)):
            status, message = "stalled", f"The residual has not fallen during the last {stall_window} evaluations of G."
            break
        if k == max_iterations:
            break
        with np.errstate(all="ignore"):
            x_next = scheme.step(x, r)
        if not np.all(np.isfinite(x_next)):
            status, message = "diverged", f"The update after evaluation {k} is not finite."
            break
        x = x_next
    scheme.end(status, x, r)
    return FixedPointResult(
        x=x.reshape(shape),
        x_tilde=x_tilde.reshape(shape),
        status=status,
        iterations=k,
        residual_norms=np.array(norms),
        field_residual_norms=dict(zip(names, np.array(field_norms).T, strict=True)),
        message=message,
    )


class _Test:
    """Convergence test and progress measure; remembers the first residuals and the best measure."""

    def __init__(self, names: list[str], atol: np.ndarray, rtol: np.ndarray, residual_rtol: np.ndarray):
        for name, a, b, c in zip(names, atol, rtol, residual_rtol, strict=True):
            if a == b == c == 0.0:
                raise ValueError(f"All tolerances of field '{name}' are zero; set atol, rtol or residual_rtol.")
        self.atol, self.rtol, self.residual_rtol = atol, rtol, residual_rtol
        self.reference = np.zeros(len(names))  # |r_1| of each field
        self.scale = np.zeros(len(names))  # first tolerance of each field that is not zero
        self.converged = False
        self.first = 0.0
        self.best = math.inf
        self.progressed_at = 0
        self.history: list[float] = []

    def measure(self, r: np.ndarray, size: np.ndarray) -> float:
        significant = r > ROUNDING * size
        self.reference = np.where((self.reference == 0.0) & significant, r, self.reference)
        tolerance = self.atol + self.rtol * size + self.residual_rtol * self.reference
        self.converged = bool(np.all((r <= tolerance) | ~significant))
        self.scale = np.where(self.scale == 0.0, tolerance, self.scale)
        with np.errstate(over="ignore"):
            m = float(np.max(r / np.where(self.scale > 0.0, self.scale, np.inf)))
        if self.first == 0.0:
            self.first = m
        if m < 0.99 * self.best:
            self.best, self.progressed_at = m, len(self.history) + 1
        self.history.append(m)
        return m

    def stalled(self, window: int) -> bool:
        if len(self.history) - self.progressed_at <= window:
            return False
        h = self.history
        return all(min(h[-p:]) >= 0.9 * min(h[-2 * p : -p]) for p in (max(1, window // 6), max(1, window // 2)))


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


def _norm(a: np.ndarray) -> float:
    """|a|_2 without overflow or underflow of the squares; nan or inf where an entry is."""
    largest = float(np.max(np.abs(a), initial=0.0))
    return largest * float(np.linalg.norm(a / largest)) if 0.0 < largest < math.inf else largest


def _partition(fields: Mapping[str, Field] | None, n: int) -> tuple[list[str], list[Field]]:
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


def _per_field(name: str, tolerance: Tolerance, names: list[str]) -> np.ndarray:
    """One value for each field, finite and not negative."""
    if isinstance(tolerance, Mapping):
        if set(tolerance) != set(names):
            raise ValueError(f"{name} must name every field once: {', '.join(names)}.")
        tolerance = [tolerance[field] for field in names]
    values = np.array(tolerance, dtype=float)
    if values.ndim == 0:
        values = np.full(len(names), float(values))
    if values.shape != (len(names),):
        raise ValueError(f"{name} must be one number or one per field ({len(names)}).")
    if not np.all(np.isfinite(values)) or np.any(values < 0.0):
        raise ValueError(f"{name} must be finite and not negative.")
    return values
