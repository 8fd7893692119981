"""What a solver core shows to the outside: its variables, and how it says that a step failed."""

from dataclasses import dataclass
from typing import Literal

import numpy as np


class StepFailed(RuntimeError):
    """A solver could not complete a step; the message is one sentence that says why."""


@dataclass(frozen=True, eq=False)
class Variable:
    """A named block of values of one solver core, as it appears in an FMU and in-process.

    `shape` is () for a scalar. `start` has that shape or is a scalar that fills it. Units are SI ("1" for none).
    `labels`, where given, name what the first index counts, one each.
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

    @property
    def size(self) -> int:
        """Number of scalars in the block."""
        return int(np.prod(self.shape, dtype=int))
