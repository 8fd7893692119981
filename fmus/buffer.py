"""The blocks of a solver core as scalars over one array: places, kinds and bounds, and what may be set.

The value reference of a scalar is its place in the array, whatever its type, so that a block is one slice.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from fmus.description import scalar_names
from interface import Variable
from interface.variables import allowed, first_outside

LARGEST = float(np.finfo(float).max)  # what is not within it is infinite or not a number
CACHE_SIZE = 256  # lists of value references: an importer repeats a few


class Buffer:
    """Values of all scalars. Whatever is refused is a ValueError of one sentence, and no value has changed then."""

    def __init__(self, variables: Sequence[Variable]) -> None:
        self.blocks: dict[str, tuple[Variable, slice]] = {}
        size = 0
        for variable in variables:
            self.blocks[variable.name] = variable, slice(size, size + variable.size)
            size += variable.size
        self.values = np.zeros(size)
        self._views = {name: self.values[where].reshape(v.shape) for name, (v, where) in self.blocks.items()}
        sizes = [v.size for v in variables]
        self._block_of = np.repeat(np.array([v.name for v in variables], dtype=object), sizes)
        self._low = np.repeat([-LARGEST if v.minimum is None else v.minimum for v in variables], sizes)
        self._high = np.repeat([LARGEST if v.maximum is None else v.maximum for v in variables], sizes)
        self._first = {where.start: where for _, where in self.blocks.values()}
        self._spans: dict[tuple[str, bool, bytes], tuple[slice | np.ndarray, tuple[str, ...]]] = {}

    def span(
        self, references: np.ndarray, kind: str, whole: bool = False
    ) -> tuple[slice | np.ndarray, tuple[str, ...]]:
        """Where value references are, and the blocks they touch, all of that kind; cached, as importers repeat.

        Each is one scalar or, where `whole`, the block whose first scalar it is.
        """
        key = kind, whole, references.tobytes()
        span = self._spans.get(key)
        if span is None:
            if len(self._spans) >= CACHE_SIZE:
                self._spans.clear()
            places = references.astype(np.int64)
            span = self._spans[key] = self._place(self._scalars(places) if whole else places, kind)
        return span

    def _scalars(self, references: np.ndarray) -> np.ndarray:
        """Places of all scalars of blocks."""
        for reference in references.tolist():
            if reference not in self._first:
                raise ValueError(f"There is no variable with the value reference {reference}.")
        return np.concatenate([np.arange(w.start, w.stop) for w in map(self._first.get, references.tolist()) if w])

    def _place(self, places: np.ndarray, kind: str) -> tuple[slice | np.ndarray, tuple[str, ...]]:
        if places.min() < 0 or places.max() >= self.values.size:
            raise ValueError(f"Value references go from 0 to {self.values.size - 1}.")
        names = tuple(dict.fromkeys(self._block_of[places]))
        for name in names:
            if self.blocks[name][0].kind != kind:
                right = self.blocks[name][0].kind.capitalize()
                raise ValueError(f"{name} is of type {right}: it is set and got as such, not as {kind.capitalize()}.")
        one_slice = bool((np.diff(places) == 1).all())
        return slice(int(places[0]), int(places[-1]) + 1) if one_slice else places, names

    def put(self, where: slice | np.ndarray, values: Sequence[float] | np.ndarray) -> bool:
        """Write values within the bounds; whether one has changed."""
        given, old = np.array(values, dtype=float), self.values[where]
        if given.shape != old.shape:
            raise ValueError(f"There are {given.size} values for {old.size} scalars.")
        k = first_outside(given, self._low[where], self._high[where])
        if k is not None:
            raise ValueError(self._outside(int(np.arange(self.values.size)[where][k]), float(given[k])))
        if np.array_equal(given, old):
            return False
        self.values[where] = given
        return True

    def _outside(self, place: int, value: float) -> str:
        """The sentence for a value that is not within the bounds of a scalar."""
        variable, where = self.blocks[self._block_of[place]]
        name = scalar_names(variable)[place - where.start]
        unit = f" {variable.unit}" if variable.unit != "1" else ""
        limits = (variable.minimum, variable.maximum) if np.isfinite(value) else (None, None)
        wanted = allowed(*limits, variable.unit)
        return f"{name} must be {wanted}, not {value:g}; it stays {self.values[place]:g}{unit}."

    def block(self, name: str) -> np.ndarray:
        """The values of a block in its shape."""
        variable, where = self.blocks[name]
        return self.values[where].reshape(variable.shape)

    def fill(self, names: Iterable[str], values: Any) -> None:
        """Take over blocks from `values`, a function of their name."""
        for name in names:
            self._views[name][...] = values(name)

    def start(self) -> dict[str, list[float]]:
        """The present values of every block, in order."""
        return {name: self.values[where].tolist() for name, (_, where) in self.blocks.items()}
