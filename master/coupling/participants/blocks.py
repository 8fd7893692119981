"""Named blocks of values: their shapes, what may be set, and how the scalars of an FMU form them."""

import ctypes
import itertools
import math
import re
from collections.abc import Iterable, Mapping
from ctypes import c_double, c_int, c_uint
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Self

import numpy as np

from interface import Criterion
from interface.variables import allowed, first_outside

SINGLE, DOUBLE = 1e-6, 1e-12  # rounding of a few operations in single and double precision, relative
NO_NUMBERS = {  # types of variables that are not exchanged -> what they are
    "String": "a text",
    "Texts": "an array of texts",
    "Binary": "binary data",
    "Clock": "a clock",
    "Clocked": "a value at the ticks of a clock",
}
INDEXED = re.compile(r"(.+?)\[(\d+(?:,\d+)*)\]", re.DOTALL)  # name[i], name[i,j]


@dataclass(frozen=True)
class Limits:
    """What a block takes: bounds are numbers or arrays of its shape, None where there are none.

    `started`: takes a start value, whatever its causality (FMI: initial is exact or approx). `kind` is "real", or
    "boolean", "integer" or "enumeration" for whole numbers; `items` are those of an enumeration, name -> value.
    """

    causality: str
    variability: str | None = None
    minimum: np.ndarray | float | None = None
    maximum: np.ndarray | float | None = None
    started: bool = False
    kind: str = "real"
    items: Mapping[str, int] = field(default_factory=dict)

    def takes(self) -> str:
        """Which values those of a kind that is not real may have, in words."""
        if self.kind == "boolean":
            return "true or false (1 or 0)"
        if self.kind == "enumeration":
            return "one of the items " + ", ".join(f"{name} ({value})" for name, value in self.items.items())
        return "whole numbers"

    def foreign(self, array: np.ndarray) -> float | None:
        """The first value that is none of the kind, None if there is none."""
        if self.kind == "boolean":
            bad = (array != 0.0) & (array != 1.0)
        elif self.kind == "enumeration" and self.items:
            bad = ~np.isin(array, list(self.items.values()))
        else:
            bad = array != np.round(array)
        return float(array.reshape(-1)[np.argmax(bad)]) if bad.any() else None


class Blocks:
    """What every participant has: names, shapes and the check of values before they are set."""

    name: str
    blocks: dict[str, tuple[int, ...]]
    limits: dict[str, Limits]
    offers_derivatives: bool = False
    criteria: tuple[Criterion, ...] = ()  # what its outputs are judged by, where it is known
    outside: dict[str, float]  # input -> first value that a source sent beyond its bounds

    @property
    def causality(self) -> dict[str, str]:
        """Block name -> "input", "output", "parameter" or another causality of FMI."""
        return {name: limits.causality for name, limits in self.limits.items()}

    def shape(self, block: str) -> tuple[int, ...]:
        """Shape of a block; ValueError with the names that there are if there is none of this name."""
        shape = self.blocks.get(block)
        if shape is None:
            raise ValueError(f"{self.name} has no block {block!r}; it has {', '.join(self.blocks) or 'none'}.")
        return shape

    def checked(self, block: str, values: Any, start: bool = False) -> np.ndarray:
        """The values as float64 if the block may be set to them (as start values), else ValueError in one sentence."""
        array = self._fitting(block, values, start)
        limits = self.limits[block]
        k = first_outside(array, limits.minimum, limits.maximum)
        if k is not None:
            value, low, high = (
                None if b is None else float(np.broadcast_to(b, array.shape).reshape(-1)[k])
                for b in (array, limits.minimum, limits.maximum)
            )
            wanted = allowed(low, high) if np.isfinite(array).all() else "finite"
            raise ValueError(f"{self.name}: block {block!r} must be {wanted}, not {value:g}.")
        if limits.kind != "real":
            self._require_kind(block, array, limits)
        return array

    def arriving(self, block: str, values: Any) -> np.ndarray:
        """The values that a source sends to an input: a bound that they miss by rounding is put in their place (that of
        single precision, beside the bounds; a bound of zero alone knows only the nominal size of 1). Those farther
        outside stay, and `outside` remembers the first. ValueError in one sentence for what is not finite or of another
        kind.
        """
        array = self._fitting(block, values, False)
        limits = self.limits[block]
        if (k := first_outside(array)) is not None:
            raise ValueError(f"{self.name}: block {block!r} must be finite, not {array.reshape(-1)[k]:g}.")
        if limits.kind != "real":
            self._require_kind(block, array, limits)
        if first_outside(array, limits.minimum, limits.maximum) is not None:
            low = -np.inf if limits.minimum is None else limits.minimum
            high = np.inf if limits.maximum is None else limits.maximum
            sizes = np.maximum(*(np.where(np.isfinite(b), np.abs(b), 0.0) for b in (low, high)))
            slack = np.where(sizes > 0.0, SINGLE * sizes, DOUBLE) if limits.kind == "real" else 0.0  # whole are exact
            inside = np.clip(array, low, high)
            array = np.where(np.abs(array - inside) <= slack, inside, array)
            if block not in self.outside and (k := first_outside(array, limits.minimum, limits.maximum)) is not None:
                self.outside[block] = float(array.reshape(-1)[k])
        return array

    def _fitting(self, block: str, values: Any, start: bool) -> np.ndarray:
        """The values as float64 of the shape of a block that may be set."""
        shape = self.shape(block)
        limits = self.limits[block]
        if limits.causality not in ("input", "parameter") and not (start and limits.started):
            raise ValueError(f"{self.name}: block {block!r} cannot be set, its causality is {limits.causality}.")
        if limits.variability == "fixed" and not start:
            raise ValueError(f"{self.name}: block {block!r} is fixed, it takes a value only before the first step.")
        try:
            array = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(f"{self.name}: block {block!r} takes numbers of shape {shape}.") from None
        if array.shape != shape:
            raise ValueError(f"{self.name}: block {block!r} has shape {shape}, not {array.shape}.")
        return array

    def _require_kind(self, block: str, array: np.ndarray, limits: Limits) -> None:
        value = limits.foreign(array)
        if value is not None:
            raise ValueError(f"{self.name}: block {block!r} takes {limits.takes()}, not {value:g}.")

    def directional_derivative(self, changes: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Derivative of the outputs of the last step along a direction in the inputs; no state is changed.

        `changes` maps input blocks to directions of their shapes, the result output blocks to derivatives. Optional for
        a participant: ValueError in one sentence where there is none, as for directions that do not fit.
        """
        raise ValueError(f"{self.name} gives no directional derivatives.")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Nothing to give back."""


def grouped(variables: Iterable[Any]) -> dict[str, tuple[list[Any], tuple[int, ...]]]:
    """Block name -> (its scalars in row-major order, shape), from variables as fmpy describes them.

    Scalars form a block if they are alike and their indices leave no gap, else each stays a block by itself.
    """
    groups: dict[str, list[tuple[tuple[int, ...], Any]]] = {}
    for variable in variables:
        if variable.type not in NO_NUMBERS:
            found = INDEXED.fullmatch(variable.name)
            name, indices = found.groups() if found else (variable.name, "")
            place = tuple(map(int, indices.split(","))) if indices else ()
            groups.setdefault(name, []).append((place, variable))
    blocks: dict[str, tuple[list[Any], tuple[int, ...]]] = {}
    for name, members in groups.items():
        members.sort(key=lambda member: member[0])
        shape = grid([place for place, _ in members])
        if shape is None or len({(v.type, v.causality, v.variability) for _, v in members}) > 1:
            blocks |= {variable.name: ([variable], ()) for _, variable in members}
        else:
            blocks[name] = [variable for _, variable in members], shape
    return blocks


def grid(places: list[tuple[int, ...]]) -> tuple[int, ...] | None:
    """Shape of the array whose every index, from any origin, is listed once in row-major order; None if it is not."""
    first, last = places[0], places[-1]
    if len(first) != len(last):
        return None
    shape = tuple(b - a + 1 for a, b in zip(first, last, strict=True))
    if min(shape, default=1) < 1 or math.prod(shape) != len(places):
        return None
    indices = itertools.product(*(range(a, b + 1) for a, b in zip(first, last, strict=True)))
    return shape if places == list(indices) else None


def described_limits(scalars: list[Any], shape: tuple[int, ...]) -> Limits:
    """Causality, variability and bounds of a block of an FMU, from the descriptions of its scalars."""
    lower = [_bound(scalar, "min") for scalar in scalars]
    upper = [_bound(scalar, "max") for scalar in scalars]
    bounded = any(map(math.isfinite, lower)), any(map(math.isfinite, upper))
    return Limits(
        scalars[0].causality,
        scalars[0].variability,
        np.reshape(lower, shape) if bounded[0] else None,
        np.reshape(upper, shape) if bounded[1] else None,
        all(s.initial in ("exact", "approx") and s.variability != "constant" for s in scalars),
        {"Real": "real", "Boolean": "boolean", "Enumeration": "enumeration"}.get(scalars[0].type, "integer"),
        _items(scalars[0]),
    )


def _items(scalar: Any) -> dict[str, int]:
    """The items of the type of a variable, name -> value."""
    declared = getattr(scalar, "declaredType", None)
    return {item.name: int(item.value) for item in getattr(declared, "items", ())}


def _bound(scalar: Any, which: str) -> float:
    """A bound of a variable, that of its type where it has none of its own."""
    own = getattr(scalar, which)
    if own is None:
        own = getattr(getattr(scalar, "declaredType", None), which, None)
    return (-math.inf if which == "min" else math.inf) if own is None else float(own)


class Channel:
    """The C arrays of one block: value references, a buffer, and numpy's view of the buffer."""

    def __init__(self, dll: Any, component: int, scalars: list[Any], shape: tuple[int, ...]) -> None:
        kind = {"Enumeration": "Integer"}.get(scalars[0].type, scalars[0].type)
        self.set_, self.get_ = getattr(dll, f"fmi2Set{kind}"), getattr(dll, f"fmi2Get{kind}")
        number = c_double if kind == "Real" else c_int
        self.values = np.zeros(shape, dtype=number)
        references = (c_uint * len(scalars))(*(scalar.valueReference for scalar in scalars))
        pointer = ctypes.cast(self.values.ctypes.data, ctypes.POINTER(number))
        self.arguments = component, ctypes.cast(references, ctypes.POINTER(c_uint)), len(scalars), pointer


def assignment_text(value: Any) -> str:
    """A value as `--set NAME=VALUE` takes it, to the last bit: vectors as 1,0,0, switches in words."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if np.ndim(value):
        return ",".join(map(assignment_text, value))
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))
