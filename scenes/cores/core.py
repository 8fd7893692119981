"""A solver behind named blocks: what is set is checked, what was solved is kept, any state can be restored."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np

from interface import Criterion, StepFailed, Variable
from interface.variables import allowed, first_outside

from ..schema import SceneError

Values = Mapping[str, np.ndarray]


class Outputs(Enum):
    """What the outputs are worth."""

    OUTDATED = "values have changed since, or the last step failed"
    CURRENT = "they belong to the present values"
    INEXACT = "they belong to the present values, to another tolerance than the present one"
    UNKNOWN = "the present values have no solution"


@dataclass(frozen=True, eq=False)
class Result:
    """What a solver found: values of blocks by name, and its state where that is another now (None: as it was)."""

    values: dict[str, Any] = field(default_factory=dict)
    state: Any = None


@dataclass(frozen=True, eq=False)
class CoreState:
    """All that later steps depend on. Arrays in it are never changed in place, so that it may share them."""

    values: dict[str, np.ndarray]
    solver: Any
    outputs: Outputs
    started: bool


class Solver:
    """What a `Core` asks of a solver. It keeps nothing between calls but what follows from values: the state that one
    step hands to the next comes and goes as an argument.
    """

    name: str = ""  # of the scene, for messages
    variables: tuple[Variable, ...] = ()
    inexact: tuple[str, ...] = ()  # parameters that no solution depends on but by its accuracy
    criteria: tuple[Criterion, ...] = ()  # what its outputs are judged by
    refuses_derivatives: str = ""  # why there are no directional derivatives, if so

    def check(self, block: str, array: np.ndarray) -> None:
        """ValueError in one sentence for values that only this solver can judge."""

    def begin(self, values: Values) -> Result:
        """State and outputs before the first step."""
        return Result()

    def follow(self, block: str, values: Values, state: Any, started: bool) -> Result:
        """What follows at once from a parameter that has changed."""
        return Result()

    def look(self, values: Values, state: Any) -> Result | None:
        """Outputs for the present values before the first step; None where they follow by themselves."""
        return None

    def must_step(self, values: Values, state: Any, t: float, dt: float) -> bool:
        """Whether a step is to be made although no value has changed."""
        return False

    def repeated(self, values: Values, state: Any, first: bool, t: float, dt: float) -> Result:
        """What a step changes in which nothing was to be solved."""
        return Result()

    def step(self, values: Values, state: Any, first: bool, t: float, dt: float) -> Result:
        """A step; StepFailed in one sentence where it cannot be made."""
        raise NotImplementedError

    def derivative(self, values: Values, state: Any) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
        """The derivative of the outputs of the last step, a function of directions in its inputs."""
        raise NotImplementedError


class Core:
    """Set / step / get / save / restore on the blocks of one solver, with derivatives where it has them.

    Blocks of no value at all (panels of a scene without any) are not shown, since FMI has no variables for them.
    A step that fails leaves all as it was: where it was the first, none has been made, and parameters that change
    still move the start.
    """

    def __init__(self, solver: Solver):
        self.solver = solver
        self.variables = tuple(v for v in solver.variables if v.size)
        self._by_name = {v.name: v for v in self.variables}
        self._shapes = {v.name: v.shape for v in solver.variables}
        self._values = {v.name: np.array(np.broadcast_to(v.start, v.shape), dtype=float) for v in solver.variables}
        self._outputs, self._started = Outputs.OUTDATED, False
        self._derivative: Any = None  # then, as soon as it is asked for
        self._require_starts()
        initial = solver.begin(self._values)
        self._state = initial.state
        self._take(replace(initial, state=None))

    def _require_starts(self) -> None:
        name = self.solver.name
        for v in self.variables:
            start = self._values[v.name]
            if first_outside(start, v.minimum, v.maximum) is not None:
                unit = "" if v.unit == "1" else f" {v.unit}"
                wanted = allowed(v.minimum, v.maximum, v.unit)
                raise SceneError(f"{name}: {v.name} starts at {start:g}{unit}, which must be {wanted}; correct it.")
            try:
                self.solver.check(v.name, start)
            except ValueError as error:
                raise SceneError(f"{name}/scene.toml: {error}") from None
        if len(self._by_name) < len(self.variables):
            names = [v.name for v in self.variables]
            twice = next(n for n in names if names.count(n) > 1)
            raise SceneError(
                f"{name}/scene.toml: two variables are named '{twice}', that of a tape, reel or load, or of an output "
                "of a model; rename one."
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all variables."""
        return tuple(self._by_name)

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """What the outputs are judged by: up to where the models are known to be good."""
        return self.solver.criteria

    @property
    def offers_derivatives(self) -> bool:
        """Whether there are directional derivatives."""
        return not self.solver.refuses_derivatives

    @property
    def refuses_derivatives(self) -> str:
        """Why there are no directional derivatives, in one sentence; "" where there are some."""
        return self.solver.refuses_derivatives

    def set(self, block: str, values: Any) -> None:
        """Copy `values` into an input or parameter; `ValueError` in one sentence if they do not fit, nothing set
        then.
        """
        variable = self._by_name.get(block)
        if variable is None or variable.causality == "output":
            known = ", ".join(v.name for v in self.variables if v.causality != "output")
            raise ValueError(f"there is no input or parameter '{block}'; there are: {known}.")
        array = _numeric(block, values, variable.shape)
        if np.array_equal(array, self._values[block]):  # which were good
            return
        bad = first_outside(array, variable.minimum, variable.maximum)
        if bad is not None:
            _finite(block, array)
            wanted = allowed(variable.minimum, variable.maximum)
            raise ValueError(f"{block} must be {wanted}; it is {array.reshape(-1)[bad]:g}.")
        if variable.kind != "real" and np.any(array != np.round(array)):
            kind = "0 or 1" if variable.kind == "boolean" else "a whole number"
            raise ValueError(f"{block} must be {kind}; it is {array:g}.")
        self.solver.check(block, array)
        self._values[block] = array
        if block not in self.solver.inexact:
            self._outdate()
        elif self._outputs is Outputs.CURRENT:
            self._outputs = Outputs.INEXACT
        if variable.causality == "parameter":
            self._take(self.solver.follow(block, self._values, self._state, self._started))

    def get(self, block: str) -> np.ndarray:
        """A copy of the present values of any block, in its shape."""
        if block not in self._by_name:
            raise ValueError(f"there is no block '{block}'; there are: {', '.join(self._by_name)}.")
        return self._values[block].copy()

    def look(self) -> None:
        """Let the outputs before the first step be those of the present values, where they are not yet.

        Where these have no solution the outputs are what they were at the beginning, and the first step says why.
        """
        if self._started or self._outputs is not Outputs.OUTDATED:
            return
        try:
            with np.errstate(all="ignore"):
                seen = self.solver.look(self._values, self._state)
            if seen is not None:
                self._take(seen, finite=True)
                self._outputs = Outputs.CURRENT
        except StepFailed:
            starts = {v.name: v.start for v in self.variables if v.causality == "output"}
            self._take(Result(starts | self.solver.begin(self._values).values))
            self._outputs = Outputs.UNKNOWN

    def step(self, t: float, dt: float) -> None:
        """Advance from t to t + dt s; where no value has changed the outputs stay. StepFailed, and all as it was, where
        that cannot be done.
        """
        first, solver = not self._started, self.solver
        if self._outputs is Outputs.CURRENT and not solver.must_step(self._values, self._state, t, dt):
            self._take(solver.repeated(self._values, self._state, first, t, dt))
        else:
            self._outdate()
            with np.errstate(all="ignore"):
                self._take(solver.step(self._values, self._state, first, t, dt), finite=True)
            self._outputs = Outputs.CURRENT
        self._started = True

    def directional_derivative(self, changes: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Derivative of the outputs of the last step along a direction in the inputs; it changes no state.

        `changes` maps interface inputs to directions of their shapes, the result interface outputs to derivatives.
        Where one half is solved, a direction is first made mirror-symmetric, because nothing else exists for the half.
        ValueError in one sentence for directions that do not fit, where the present values have not been solved, and
        where there are no derivatives.
        """
        if self.solver.refuses_derivatives:
            raise ValueError(self.solver.refuses_derivatives)
        directions = self._directions(changes)
        if self._derivative is None:
            self._derivative = self.solver.derivative(self._values, self._state)
        return self._derivative(directions)

    def _directions(self, changes: Mapping[str, Any]) -> dict[str, np.ndarray]:
        solved = self._outputs in (Outputs.CURRENT, Outputs.INEXACT)
        if not (self._started and solved):
            why = self._outputs.value if self._started else "no step has been made yet"
            raise ValueError(f"there is no solved state to take a derivative at: {why}.")
        inputs = {v.name: v.shape for v in self.variables if v.causality == "input"}
        for block in changes:
            if block not in inputs:
                raise ValueError(f"there is no interface input '{block}'; there are: {', '.join(inputs)}.")
        return {
            block: _finite(f"the direction of {block}", _numeric(f"the direction of {block}", values, inputs[block]))
            for block, values in changes.items()
        }

    def save(self) -> CoreState:
        """The complete state; later changes of the core leave it alone."""
        return CoreState(dict(self._values), self._state, self._outputs, self._started)

    def restore(self, state: CoreState) -> None:
        """Return to a saved state; the next steps repeat bitwise."""
        self._values, self._state = dict(state.values), state.solver
        self._outputs, self._started = state.outputs, state.started
        self._derivative = None

    def _outdate(self) -> None:
        self._outputs, self._derivative = Outputs.OUTDATED, None

    def _take(self, result: Result, finite: bool = False) -> None:
        """Take a result over; where its values have to be `finite` and one is not, StepFailed, and all as it was."""
        arrays = self._arrays(result)
        bad = next((k for k, v in arrays.items() if not np.isfinite(v).all()), None) if finite else None
        if bad is not None:
            raise StepFailed(f"{bad} is not finite; what was set is too large.")
        self._values |= arrays
        self._state = self._state if result.state is None else result.state

    def _arrays(self, result: Result) -> dict[str, np.ndarray]:
        shapes = self._shapes
        return {k: _filled(v, shapes[k]) for k, v in result.values.items()}


def _filled(values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A new array of a shape with these values, or filled with this one."""
    array = np.array(values, dtype=float)
    return array if array.shape == shape else np.array(np.broadcast_to(array, shape))


def _numeric(what: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Float64 values of a shape; ValueError in one sentence otherwise."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{what} must be numeric and finite, not {str(values)[:40]!r}.") from None
    if array.shape != shape:
        raise ValueError(f"{what} has shape {shape}, not {array.shape}.")
    return array


def _finite(what: str, array: np.ndarray) -> np.ndarray:
    if not np.isfinite(array).all():
        raise ValueError(f"{what} must be finite; it contains NaN or infinity.")
    return array
