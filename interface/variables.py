"""Named blocks of values, as a solver shows them to the outside, and what their bounds allow."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np


@dataclass(frozen=True, eq=False)
class Variable:
    """A named block of values of one solver core, as it appears in an FMU and in-process.

    `shape` is () for a scalar. `start` has that shape or is a scalar that fills it. Units are SI ("1" for none).
    `counts` says what the first index counts ("panel", "strip", ...), `labels`, where given, name these, one each.
    """

    name: str
    shape: tuple[int, ...] = ()
    causality: Literal["parameter", "input", "output"] = "input"
    variability: Literal["fixed", "tunable", "continuous", "discrete"] = "continuous"
    kind: Literal["real", "boolean", "integer"] = "real"
    unit: str = "1"
    description: str = ""
    start: float | np.ndarray = 0.0
    minimum: float | None = None
    maximum: float | None = None
    labels: tuple[str, ...] = ()
    counts: str = ""

    @property
    def size(self) -> int:
        """Number of scalars in the block."""
        return int(np.prod(self.shape, dtype=int))


def first_outside(values: Any, low: Any = None, high: Any = None) -> int | None:
    """Place of the first of the `values` (flattened) that is not finite or not within its bounds, numbers or arrays of
    the shape of the values (None: unbounded); None where all are.
    """
    values = np.asarray(values, dtype=float)
    right = np.isfinite(values)
    if low is not None:
        right &= values >= low
    if high is not None:
        right &= values <= high
    return None if right.all() else int(np.argmin(right))


def allowed(low: float | None, high: float | None, unit: str = "1") -> str:
    """What values within bounds are, for a sentence: "at least 3 m", "between 0 and 1", "finite"."""
    of = "" if unit == "1" else f" {unit}"
    if low is None or not np.isfinite(low):
        return "finite" if high is None or not np.isfinite(high) else f"at most {high:g}{of}"
    return f"at least {low:g}{of}" if high is None or not np.isfinite(high) else f"between {low:g} and {high:g}{of}"
