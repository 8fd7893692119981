"""Up to where models are known to be good: bounds of scalar outputs, and where in a model a value stands worst."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from .variables import Variable

# Values this close, as part of the larger, count as one, and the first of them is named: left and right of a symmetric
# kite differ by rounding, and would take turns else.
ALIKE = 1e-9


@dataclass(frozen=True)
class Criterion:
    """What an answer is judged by: the output `name`, a scalar, is at most `limit`, by what `source` says.

    `quantity` is what a sentence calls it. The output `place` counts from 1, in the `labels`, where the largest value
    stands (0: nowhere); where there is only one place, `where` says what is to be known of it. `percent`: values are
    shown as such; `whole`: they are counts.
    """

    name: str
    quantity: str
    limit: float
    source: str
    labels: tuple[str, ...] = ()
    where: str = ""
    percent: bool = False
    whole: bool = False

    @property
    def place(self) -> str:
        """Name of the output that says where."""
        return f"{self.name}_at"

    def within(self, value: float) -> bool:
        """Whether a value is within its limit; one that is no number is not."""
        return bool(value <= self.limit)

    def text(self, value: float) -> str:
        """A value, or the limit, as a sentence shows it."""
        return f"{100.0 * value:.3g} %" if self.percent else f"{value:.3g}"

    def named(self, place: float) -> str:
        """The name of a place, by the value of the output `place`; "" for none."""
        at = int(place) if np.isfinite(place) else 0
        return self.labels[at - 1] if 0 < at <= len(self.labels) else self.where

    def variables(self, counted: str = "") -> tuple[Variable, ...]:
        """The outputs that it needs; `counted` is what the place counts, and without it there is no place."""
        text = f"{self.quantity}, the largest; known to be good up to {self.text(self.limit)} ({self.source})"
        output = partial(Variable, causality="output")
        value = output(self.name, kind="integer" if self.whole else "real", description=text)
        if not counted:
            return (value,)
        text = f"number of the {counted} with the largest {self.quantity}, from 1; 0: none"
        return value, output(self.place, kind="integer", description=text)


def worst(values: np.ndarray) -> tuple[float, int]:
    """The largest of the values (k,) and its number, from 1; 0 and 0 where none is above zero. One that is no number is
    the worst of all.
    """
    most = float(values.max(initial=0.0))
    if np.isnan(most):
        return most, int(np.argmax(np.isnan(values))) + 1
    return (most, int(np.argmax(values >= most * (1.0 - ALIKE))) + 1) if most > 0.0 else (0.0, 0)


def outside(criteria: Iterable[Criterion], outputs: Mapping[str, Any]) -> int:
    """How many of the criteria the outputs do not meet."""
    return sum(not c.within(float(outputs[c.name])) for c in criteria)


def outside_variable() -> Variable:
    """The output that counts them."""
    text = "number of quantities beyond what the model is known to be good for; 0: none"
    return Variable("outside_validity", causality="output", kind="integer", description=text)
