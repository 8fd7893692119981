"""A solver core as an FMI co-simulation slave: its blocks become scalars over one buffer.

A value is checked where it is set: one that is refused is logged, the old one stays. A step hands the blocks that
changed to the core, solves, and fetches the outputs.

Nothing may leave the methods that a binary calls: they log one sentence instead, for which that of this project
(fmus/binary) returns fmi2Error. That of PythonFMU, in FMUs for other platforms, cannot, and answers an exception with
fmi2Fatal and a double free; so the step that follows a refusal is discarded too.
"""

import contextlib
import hashlib
import math
import sys
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol
from xml.etree.ElementTree import Element

import numpy as np
from pythonfmu import DefaultExperiment
from pythonfmu.enums import Fmi2Status

from fmus.accessors import ValueSlave
from fmus.buffer import Buffer
from fmus.description import add_variables, describe_model
from fmus.sharing import end_cleanly
from fmus.stored_scene import read_scene
from interface import StepFailed, Variable, records
from scenes import Scene

STATE = b"kitecosim state "  # what a serialised state begins with; its layout, a line end, its SHA-256 and a record
LAYOUT = 3  # of serialised states: 3 is `interface.records`; pickles were 2

# States of a co-simulation slave (FMI 2.0.4, section 4.2.4); each call is allowed in some of them.
INSTANTIATED, INITIALIZATION_MODE = "instantiated", "in initialization mode"
SLAVE_INITIALIZED, TERMINATED = "initialized", "terminated"


class Core(Protocol):
    """What a solver shows: its variables, and set / step / get / save / restore on them."""

    variables: tuple[Variable, ...]

    def set(self, block: str, values: Any) -> None: ...
    def step(self, t: float, dt: float) -> None: ...
    def get(self, block: str) -> np.ndarray: ...
    def look(self) -> None: ...
    def save(self) -> object: ...
    def restore(self, state: Any) -> None: ...


class CoreFmu(ValueSlave):
    """FMI slave of one solver core: the given one, or the one of the scene in the FMU's resources."""

    title = "Solver"
    at_start: tuple[str, ...] = ("parameter",)  # causalities that outputs depend on in initialization mode
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=1.0)
    log_categories = {  # noqa: RUF012 (as PythonFMU has it)
        "logStatusError": "A value or a state that was refused; the next step is discarded.",
        "logStatusDiscard": "Why a step was discarded.",
    }

    def __init__(self, core: Core | None = None, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        if self.resources is not None and str(self.resources) in sys.path:  # left there by a binary
            sys.path.remove(str(self.resources))
        self._core = self._resource_core(Path(self.resources)) if core is None else core
        self._buffer = Buffer(self._core.variables)
        self.blocks = self._buffer.blocks
        self._layout = tuple((variable.name, variable.shape) for variable in self._core.variables)
        self._outputs = [name for name, (variable, _) in self.blocks.items() if variable.causality == "output"]
        self._locked = set(self._outputs)
        # What the core checks as soon as it is set. A vector may be half set then; inputs are checked by their bounds.
        self._checked_at_once = {
            name for name, (v, _) in self.blocks.items() if v.causality == "parameter" and v.size == 1
        }
        self._dirty: set[str] = set()
        self._outdated = False  # values have been set since the initial unknowns were calculated
        self._mode = INSTANTIATED
        self._pending_error: str | None = None  # of a call that failed since the last step
        self._restore_error: str | None = None  # of a state that could not be restored
        self._time = 0.0
        self._fetch(self.blocks)
        if self.resources is not None:
            end_cleanly(Path(self.resources))

    @staticmethod
    def scene_core(scene: Scene) -> Core:
        """The core that this FMU shows, from its scene."""
        raise NotImplementedError

    def _resource_core(self, resources: Path) -> Core:
        scene, parameters = read_scene(resources)
        if scene.dynamics is not None:
            stop, step = scene.dynamics.stop_time, scene.communication_step
            self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=stop, step_size=step)
        core = self.scene_core(scene)
        for name, value in parameters.items():
            core.set(name, np.array(value, dtype=float))
        return core

    # Between buffer and core

    def _push(self, names: Container[str]) -> None:
        """Hand those of the blocks that have changed to the core; the first that it refuses raises ValueError, and has
        its old value again.

        Parameters go first, as a core may derive start values of inputs from them.
        """
        changed = [name for name in self.blocks if name in self._dirty and name in names]
        failed: ValueError | None = None
        for name in sorted(changed, key=lambda name: self.blocks[name][0].causality == "input"):
            self._dirty.discard(name)
            try:
                with np.errstate(all="ignore"):
                    self._core.set(name, self._buffer.block(name))
            except ValueError as error:
                self._fetch([name])
                failed = failed or error
        if failed is not None:
            raise failed

    def _fetch(self, names: Iterable[str]) -> None:
        with np.errstate(all="ignore"):
            self._buffer.fill(names, self._core.get)

    def _require(self, call: str, *modes: str) -> None:
        if self._mode not in modes:
            raise ValueError(f"{call} is not allowed now: the FMU is {self._mode}, not {' or '.join(modes)}.")

    def _logged(self, error: BaseException | str, status: Fmi2Status) -> str:
        """Log one sentence; FMI takes it as a printf format, so that per cent signs are doubled."""
        plain = isinstance(error, str | ValueError | StepFailed)
        sentence = " ".join((str(error) if plain else f"{type(error).__name__}: {error}").split())
        self.log(sentence.replace("%", "%%"), status)
        return sentence

    # Variables

    def _put(
        self, references: np.ndarray, values: Sequence[float] | np.ndarray, kind: str, whole: bool = False
    ) -> None:
        try:
            self._require("Setting a variable", INSTANTIATED, INITIALIZATION_MODE, SLAVE_INITIALIZED)
            if not len(references):
                return
            where, names = self._buffer.span(references, kind, whole)
            if not self._locked.isdisjoint(names):
                name = min(self._locked.intersection(names))
                why = "an output" if name in self._outputs else "a fixed parameter, set before initialization mode ends"
                raise ValueError(f"{name} cannot be set: it is {why}.")
            old, dirty = self._buffer.values[where].copy(), set(self._dirty)
            at_once = self._checked_at_once.intersection(names)
            if self._buffer.put(where, values) or self._mode != SLAVE_INITIALIZED:
                self._dirty.update(names)
                self._outdated = True
                try:
                    self._push(at_once)
                except ValueError:  # of the core: no value of this call stays
                    self._buffer.values[where] = old
                    self._dirty = dirty | at_once
                    self._push(at_once)
                    raise
        except BaseException as error:
            self._pending_error = self._logged(error, Fmi2Status.error)

    def _take(self, references: np.ndarray, kind: str, whole: bool = False) -> np.ndarray | None:
        """Values of scalars; None, and a message, where that fails."""
        try:
            if self._mode == INITIALIZATION_MODE and self._outdated:
                self._calculate_initial_unknowns()
            return self._buffer.values[self._buffer.span(references, kind, whole)[0]]
        except BaseException as error:
            self._logged(error, Fmi2Status.error)
            return None

    # State machine

    def _calculate_initial_unknowns(self) -> None:
        """Outputs, and inputs that were not set, follow the start values set so far."""
        self._outdated = False
        for update in (lambda: self._push(self.blocks), self._core.look, lambda: self._fetch(self.blocks)):
            try:
                update()
            except BaseException as error:
                self._pending_error = self._logged(error, Fmi2Status.error)

    def _enter(self, call: str, before: tuple[str, ...], after: str) -> bool:
        """Go over to another state, where that is allowed."""
        try:
            self._require(call, *before)
        except ValueError as error:
            self._pending_error = self._logged(error, Fmi2Status.error)
            return False
        self._mode = after
        return True

    def setup_experiment(self, start_time: float = 0.0, *_: Any) -> None:
        if self._enter("Setting up the experiment", (INSTANTIATED,), INSTANTIATED):
            self._time = start_time

    def enter_initialization_mode(self) -> None:
        if self._enter("Entering initialization mode", (INSTANTIATED,), INITIALIZATION_MODE):
            self._calculate_initial_unknowns()

    def exit_initialization_mode(self) -> None:
        if self._enter("Exiting initialization mode", (INITIALIZATION_MODE,), SLAVE_INITIALIZED):
            self._calculate_initial_unknowns()
            self._locked |= {name for name, (v, _) in self.blocks.items() if v.variability == "fixed"}

    def terminate(self) -> None:
        self._enter("Terminating", (INITIALIZATION_MODE, SLAVE_INITIALIZED), TERMINATED)
        with contextlib.suppress(BaseException):
            end_cleanly(Path(self.resources))  # again, to come before libraries that were loaded since

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One step of the core with the present inputs; False (fmi2Discard) with a logged sentence if it fails."""
        try:
            self._require("A step", SLAVE_INITIALIZED)
            if not (math.isfinite(current_time) and 0.0 < step_size < math.inf):
                raise ValueError(f"A step from {current_time:g} s by {step_size:g} s is none: it goes forward in time.")
            error, self._pending_error = self._restore_error or self._pending_error, None
            if error:
                raise StepFailed(error)
            self._push(self.blocks)
            with np.errstate(all="ignore"):  # of a solver that fails, which raises StepFailed
                self._core.step(current_time, step_size)
            self._fetch(self._outputs)
            self._time = current_time + step_size
            return True
        except BaseException as error:
            self._logged(error, Fmi2Status.discard)
            return False

    # Complete state

    def _get_fmu_state(self) -> Any:
        try:
            mode = self._mode, frozenset(self._locked), self._pending_error
            values = self._buffer.values.copy()
            return self._layout, self._core.save(), values, frozenset(self._dirty), self._time, mode
        except BaseException as error:
            return self._logged(
                error, Fmi2Status.error
            )  # as is every failure below, reported by the step after a restore

    def _set_fmu_state(self, state: Any) -> None:
        try:
            if isinstance(state, str):
                raise ValueError(state)
            layout, saved, values, dirty, time, mode = state
            if layout != self._layout:
                raise ValueError("The state belongs to an FMU with other variables.")
            self._core.restore(saved)
            self._buffer.values[:], self._dirty, self._time = values, set(dirty), time
            self._mode, locked, self._pending_error = mode
            self._locked, self._restore_error, self._outdated = set(locked), None, True
        except BaseException as error:
            self._restore_error = self._logged(error, Fmi2Status.error)

    def serialize(self, state: Any) -> bytes:
        """The bytes of a state, as the binary of this project asks for them; what cannot be serialised is logged."""
        try:
            return self._fmu_state_to_bytes(state, strict=True)
        except BaseException as error:
            self._logged(f"The state cannot be serialised: {error}", Fmi2Status.error)
            return self._fmu_state_to_bytes(state)

    def deserialize(self, content: bytes) -> Any:
        """The state of bytes, as the binary of this project asks for it; None, and a message, where they are no state
        that this FMU could be restored to.
        """
        state = self._fmu_state_from_bytes(content)
        if isinstance(state, tuple) and len(state) == 6 and state[0] == self._layout:
            return state
        other = "The state belongs to an FMU with other variables."
        self._logged(state if isinstance(state, str) else other, Fmi2Status.error)
        return None

    @staticmethod
    def _fmu_state_to_bytes(state: Any, strict: bool = False) -> bytes:
        """As PythonFMU's binary asks for them: it can hear of no failure, which the bytes tell whoever restores them,
        unless `strict`.
        """
        try:
            content = records.dumps(state)
        except BaseException as error:
            if strict:
                raise
            content = records.dumps(f"The state cannot be serialised: {error}")
        return STATE + b"%d\n" % LAYOUT + hashlib.sha256(content).digest() + content

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> Any:
        """A state, or the sentence that says why it is none, which is logged when it is restored."""
        try:
            start, _, rest = bytes(state).partition(b"\n")
            if start.startswith(STATE) and start != STATE + b"%d" % LAYOUT:
                layout = start.removeprefix(STATE).decode("ascii")[:20]
                return f"The serialised state has the layout {layout}; this FMU reads {LAYOUT}: save one with it."
            if not start.startswith(STATE) or hashlib.sha256(rest[32:]).digest() != rest[:32]:
                return "The bytes are not a serialised state of this FMU, or were changed."
            return records.loads(rest[32:])
        except BaseException as error:
            return f"The serialised state cannot be read: {error}"

    def start(self, block: str) -> list[float]:
        """The present values of a block, in order."""
        return self._buffer.start()[block]

    def to_xml(self, model_options: Mapping[str, Any] | None = None) -> Element:
        """The complete model description; it does not depend on the time of the build."""
        options = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True} | dict(model_options or {})
        root: Element = super().to_xml(options)
        describe_model(root)
        add_variables(root, self._core.variables, self._buffer.start(), self.at_start)
        return root
