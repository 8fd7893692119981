"""What both solver cores share: blocks of values with checks, stored outputs, complete state."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from interface import StepFailed, Variable

from .tables import SceneError


class Core:
    """Values of a core's variables and the rules for setting them; subclasses add `step`.

    The state is everything that later steps depend on: all values and what subclasses name in `_hidden`. Caches that
    follow from these are not part of it. `_inert` names parameters that no solution depends on.
    """

    _hidden: tuple[str, ...] = ()
    _inert: tuple[str, ...] = ()

    def __init__(self, scene: str, variables: tuple[Variable, ...]):
        self.variables = variables
        self._by_name = {v.name: v for v in variables}
        self._outputs = {v.name for v in variables if v.causality == "output"}
        self._values = {v.name: np.array(np.broadcast_to(v.start, v.shape), dtype=float) for v in variables}
        self._stale = True
        self._fresh = True  # no step yet
        self._solved = False  # outputs belong to the present values
        self._linearised: Any = None  # then, as soon as a derivative is asked for
        for v in variables:
            start = self._values[v.name]
            low, high = -np.inf if v.minimum is None else v.minimum, np.inf if v.maximum is None else v.maximum
            if np.any(start < low) or np.any(start > high):
                unit = "" if v.unit == "1" else f" {v.unit}"
                bounds = f"at least {low:g}{unit}" if high == np.inf else f"between {low:g} and {high:g}{unit}"
                raise SceneError(f"{scene}: {v.name} starts at {start:g}{unit}, which must be {bounds}; correct it.")
            try:
                self._check(v.name, start)
            except ValueError as error:
                raise SceneError(f"{scene}/scene.toml: {error}") from None
        if len(self._by_name) < len(variables):
            names = [v.name for v in variables]
            twice = next(n for n in names if names.count(n) > 1)
            raise SceneError(f"{scene}/scene.toml: two variables are named '{twice}'; rename the tape or load.")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all variables."""
        return tuple(self._by_name)

    def set(self, block: str, values: Any) -> None:
        """Copy `values` into an input or parameter; `ValueError` in one sentence if they do not fit, nothing set
        then.
        """
        variable = self._by_name.get(block)
        if variable is None or variable.causality == "output":
            known = ", ".join(v.name for v in self.variables if v.causality != "output")
            raise ValueError(f"there is no input or parameter '{block}'; there are: {known}.")
        try:
            array = np.array(values, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{block} must be numeric and finite, not {str(values)[:40]!r}.") from None
        if array.shape != variable.shape:
            raise ValueError(f"{block} has shape {variable.shape}, not {array.shape}.")
        if not np.all(np.isfinite(array)):
            raise ValueError(f"{block} must be finite; it contains NaN or infinity.")
        low, high = variable.minimum, variable.maximum
        if (low is not None and array.min(initial=low) < low) or (high is not None and array.max(initial=high) > high):
            bounds = f"at least {low:g}" if high is None else f"between {low:g} and {high:g}"
            raise ValueError(f"{block} must be {bounds}; it is {array.min() if array.size else array:g}.")
        if variable.kind != "real" and np.any(array != np.round(array)):
            kind = "0 or 1" if variable.kind == "boolean" else "a whole number"
            raise ValueError(f"{block} must be {kind}; it is {array:g}.")
        self._check(block, array)
        if not np.array_equal(array, self._values[block]):
            self._values[block] = array
            self._stale = True
            if block not in self._inert:
                self._unsolved()
            if variable.causality == "parameter":
                self._parameter_changed(block)

    def get(self, block: str) -> np.ndarray:
        """A copy of the present values of any block, in its shape."""
        if block not in self._values:
            raise ValueError(f"there is no block '{block}'; there are: {', '.join(self._values)}.")
        return self._values[block].copy()

    def save(self) -> dict[str, Any]:
        """The complete state; later changes of the core leave it alone."""
        state = {k: v.copy() for k, v in self._values.items()}
        hidden = {k: _copy(getattr(self, k)) for k in self._hidden}
        return {"values": state, "hidden": hidden, "stale": self._stale}

    def restore(self, state: dict[str, Any]) -> None:
        """Return to a saved state; the next steps repeat bitwise."""
        self._values = {k: v.copy() for k, v in state["values"].items()}
        for key, value in state["hidden"].items():
            setattr(self, key, _copy(value))
        self._stale = state["stale"]
        self._linearised = None
        self._restored()

    def _directions(self, changes: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """The directions `changes` of interface inputs (block -> values) as arrays; ValueError in one sentence for
        those that do not fit, and where the last step has not solved the present values.
        """
        if self._fresh or not self._solved:
            why = "no step has been made yet" if self._fresh else "values have changed since, or the last step failed"
            raise ValueError(f"there is no solved state to take a derivative at: {why}.")
        inputs = {v.name: v.shape for v in self.variables if v.causality == "input"}
        directions = {}
        for block, values in changes.items():
            if block not in inputs:
                raise ValueError(f"there is no interface input '{block}'; there are: {', '.join(inputs)}.")
            try:
                array = np.array(values, dtype=float)
            except (TypeError, ValueError, OverflowError):
                raise ValueError(f"the direction of {block} must be numeric, not {str(values)[:40]!r}.") from None
            if array.shape != inputs[block]:
                raise ValueError(f"the direction of {block} has shape {inputs[block]}, not {array.shape}.")
            if not np.all(np.isfinite(array)):
                raise ValueError(f"the direction of {block} must be finite; it contains NaN or infinity.")
            directions[block] = array
        return directions

    def _check(self, block: str, array: np.ndarray) -> None:
        """Raise ValueError for values that only the subclass can judge."""

    def _parameter_changed(self, block: str) -> None:
        """Drop what was derived from a parameter."""

    def _restored(self) -> None:
        """Drop what was derived from values that have just been replaced."""

    def _unsolved(self) -> None:
        """Note that the outputs no longer belong to the present values."""
        self._solved, self._linearised = False, None

    def _put(self, block: str, values: Any) -> None:
        self._values[block] = np.array(np.broadcast_to(values, self._by_name[block].shape), dtype=float)

    @contextmanager
    def _finite_results(self) -> Iterator[None]:
        """Where the results of a step are put out; StepFailed, and all as it was, if one of them is not finite."""
        values, hidden = dict(self._values), {k: getattr(self, k) for k in self._hidden}
        try:
            with np.errstate(all="ignore"):
                yield
            bad = next((k for k in self._values if not np.isfinite(self._values[k]).all()), None)
            if bad is not None:
                raise StepFailed(f"{bad} is not finite; what was set is too large.")
        except BaseException:
            self._values = values
            for key, value in hidden.items():
                setattr(self, key, value)
            raise

    def _scalar(self, block: str) -> float:
        return float(self._values[block])


def _copy(value: Any) -> Any:
    return value.copy() if isinstance(value, np.ndarray) else value
