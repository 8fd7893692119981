"""A solver core as an FMI 2.0 co-simulation slave: its blocks become scalars over one buffer.

The value reference of a scalar is its place in the buffer, whatever its type, so that a block is one slice. Setting
writes the buffer only; a step hands the blocks that changed to the core, solves, and fetches the outputs.

PythonFMU answers an exception with fmi2Fatal and a double free in the host. Nothing may leave the methods it calls:
they log one sentence instead, and the step that follows is discarded (it is the only call that can report a failure).
"""

import contextlib
import ctypes
import json
import math
import os
import pickle
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol
from xml.etree.ElementTree import Element

import numpy as np
from pythonfmu import DefaultExperiment, Fmi2Slave
from pythonfmu.enums import Fmi2Status

import scenes
from fmus.description import add_variables, describe_model
from fmus.sharing import share_modules
from scenes.variables import StepFailed, Variable

INNER = "pythonfmu.so"  # in the folder of the binary, where one of this project stands before that of PythonFMU
SCENE_FILE = "scene.json"  # in the resources: folder, settings, start values of parameters


class Core(Protocol):
    """What a solver shows: its variables, and set / step / get / save / restore on them."""

    variables: tuple[Variable, ...]

    def set(self, block: str, values: Any) -> None: ...
    def step(self, t: float, dt: float) -> None: ...
    def get(self, block: str) -> np.ndarray: ...
    def save(self) -> object: ...
    def restore(self, state: Any) -> None: ...


def _end_cleanly(resources: Path) -> None:
    """Let go of the interpreter as the first thing when the process exits.

    Left to itself, PythonFMU's binary does it while it is unloaded, twice, the second time on freed memory and, where
    it owns the interpreter, after the libraries of numpy and scipy have ended: the process may abort or hang at exit,
    after correct results. Its own function, called before all that, leaves nothing to do for the two. Where a binary of
    this project stands before it, that one does this (fmus/front).
    """
    if any((resources.parent / "binaries").glob(f"*/{INNER}")):
        return
    for path in (resources.parent / "binaries").glob("*/*.so"):
        with contextlib.suppress(OSError, AttributeError):  # of another platform, or made otherwise
            library = ctypes.CDLL(str(path), mode=os.RTLD_NOLOAD | os.RTLD_NOW)  # and thereby never unmapped
            last = ctypes.cast(library.finalizePythonInterpreter, ctypes.c_void_p)
            getattr(ctypes.CDLL(None), "__cxa_atexit")(last, None, None)


class CoreFmu(Fmi2Slave):
    """FMI slave of one solver core: the given one, or the one of the scene in the FMU's resources."""

    title = "Solver"
    at_start: tuple[str, ...] = ("parameter",)  # causalities of what the outputs depend on while initialising
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=1.0)
    log_categories = {  # noqa: RUF012 (as PythonFMU has it)
        "logStatusError": "A value or a state that was refused; the next step is discarded.",
        "logStatusDiscard": "Why a step was discarded.",
    }

    def __init__(self, core: Core | None = None, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        if self.resources is not None:
            share_modules(Path(self.resources))
        self._core = self._resource_core(Path(self.resources)) if core is None else core
        self.blocks: dict[str, tuple[Variable, slice]] = {}
        size = 0
        for variable in self._core.variables:
            self.blocks[variable.name] = variable, slice(size, size + variable.size)
            size += variable.size
        self._layout = tuple((variable.name, variable.shape) for variable in self._core.variables)
        self._buffer = np.zeros(size)
        self._block_of = np.repeat(np.array(list(self.blocks)), [v.size for v, _ in self.blocks.values()])
        self._spans: dict[tuple[int, int], tuple[list[int], slice | np.ndarray, frozenset[str]]] = {}
        self._outputs = [name for name, (variable, _) in self.blocks.items() if variable.causality == "output"]
        self._locked = set(self._outputs)
        self._dirty: set[str] = set()
        self._initialising = False
        self._refused: str | None = None  # a set that failed since the last step
        self._lost: str | None = None  # a state that could not be restored
        self._time = 0.0
        self._fetch(self.blocks)
        if self.resources is not None:
            _end_cleanly(Path(self.resources))

    @staticmethod
    def scene_core(scene: scenes.Scene) -> Core:
        """The core that this FMU shows, from its scene."""
        raise NotImplementedError

    def _resource_core(self, resources: Path) -> Core:
        content = json.loads((resources / SCENE_FILE).read_text(encoding="utf-8"))
        core = self.scene_core(scenes.load(resources / content["folder"], content["settings"]))
        for name, value in content["parameters"].items():
            core.set(name, np.array(value, dtype=float))
        return core

    # Between buffer and core

    def _push(self) -> None:
        """Hand the changed blocks to the core; one that it refuses stays changed, and the core keeps its old value.

        Parameters go first, as a core may derive start values of inputs from them.
        """
        changed = [name for name in self.blocks if name in self._dirty]
        for name in sorted(changed, key=lambda name: self.blocks[name][0].causality == "input"):
            variable, where = self.blocks[name]
            self._core.set(name, self._buffer[where].reshape(variable.shape))
            self._dirty.discard(name)

    def _fetch(self, names: Any) -> None:
        for name in names:
            self._buffer[self.blocks[name][1]] = np.asarray(self._core.get(name), dtype=float).reshape(-1)

    def _span(self, vrs: list[int]) -> tuple[slice | np.ndarray, frozenset[str]]:
        """Where in the buffer value references are, and the blocks they touch; remembered, as importers repeat them."""
        key = vrs[0], len(vrs)
        known = self._spans.get(key)
        if known is None or known[0] != vrs:
            places = np.array(vrs)
            if places.min() < 0 or places.max() >= self._buffer.size:
                raise ValueError(f"Value references go from 0 to {self._buffer.size - 1}.")
            one_slice = bool((np.diff(places) == 1).all())
            where = slice(vrs[0], vrs[0] + len(vrs)) if one_slice else places
            known = self._spans[key] = list(vrs), where, frozenset(self._block_of[places].tolist())
        return known[1], known[2]

    def _say(self, error: BaseException | str, status: Fmi2Status) -> str:
        """Log one sentence; FMI takes it as a printf format, so that per cent signs are doubled."""
        plain = isinstance(error, str | ValueError | StepFailed)
        sentence = " ".join((str(error) if plain else f"{type(error).__name__}: {error}").split())
        self.log(sentence.replace("%", "%%"), status)
        return sentence

    # Variables

    def _put(self, vrs: list[int], values: Sequence[float]) -> None:
        try:
            if vrs:
                where, names = self._span(vrs)
                if not self._locked.isdisjoint(names):
                    name = min(self._locked.intersection(names))
                    why = "an output" if name in self._outputs else "a fixed parameter, set before initialisation"
                    raise ValueError(f"{name} cannot be set: it is {why}.")
                self._buffer[where] = values
                self._dirty |= names
        except BaseException as error:
            self._refused = self._say(error, Fmi2Status.error)

    def _values(self, vrs: list[int], kind: Callable[[float], Any], bad: Any) -> list[Any]:
        if not vrs:
            return []
        if self._initialising and self._dirty:
            self._settle()
        try:
            values: list[Any] = self._buffer[self._span(vrs)[0]].tolist()
            return values if kind is float else [kind(value) for value in values]
        except BaseException as error:
            self._say(error, Fmi2Status.error)
            return [bad] * len(vrs)

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self._put(vrs, values)

    set_integer = set_boolean = set_real

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._refused = self._say("There are no String variables.", Fmi2Status.error)

    def get_real(self, vrs: list[int]) -> list[float]:
        return self._values(vrs, float, math.nan)

    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._values(vrs, round, 0)

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return self._values(vrs, bool, False)

    def get_string(self, vrs: list[int]) -> list[str]:
        self._say("There are no String variables.", Fmi2Status.error)
        return [""] * len(vrs)

    # Life

    def _settle(self) -> None:
        """Outputs, and inputs that were not set, that reflect the start values set so far."""
        try:
            self._push()
            self._fetch(self.blocks)
        except BaseException as error:
            self._say(error, Fmi2Status.error)

    def setup_experiment(self, start_time: float = 0.0, *_: Any) -> None:
        self._time = start_time

    def enter_initialization_mode(self) -> None:
        self._initialising = True
        self._settle()

    def exit_initialization_mode(self) -> None:
        self._settle()
        self._initialising = False
        self._locked |= {name for name, (v, _) in self.blocks.items() if v.variability == "fixed"}

    def terminate(self) -> None:
        with contextlib.suppress(BaseException):
            _end_cleanly(Path(self.resources))  # again, to come before libraries that were loaded since

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One step of the core with the present inputs; False (fmi2Discard) with a logged sentence if it fails."""
        try:
            refused, self._refused = self._lost or self._refused, None
            if refused:
                raise StepFailed(refused)
            self._push()
            self._core.step(current_time, step_size)
            self._fetch(self._outputs)
            self._time = current_time + step_size
            return True
        except BaseException as error:
            self._say(error, Fmi2Status.discard)
            return False

    # Complete state

    def _get_fmu_state(self) -> Any:
        try:
            mode = self._initialising, frozenset(self._locked), self._refused
            return self._layout, self._core.save(), self._buffer.copy(), frozenset(self._dirty), self._time, mode
        except BaseException as error:
            return self._say(error, Fmi2Status.error)  # as is every failure below, reported by the step after a restore

    def _set_fmu_state(self, state: Any) -> None:
        try:
            if isinstance(state, str):
                raise ValueError(state)
            layout, saved, buffer, dirty, time, mode = state
            if layout != self._layout:
                raise ValueError("The state belongs to an FMU with other variables.")
            self._core.restore(saved)
            self._buffer[:], self._dirty, self._time = buffer, set(dirty), time
            self._initialising, locked, self._refused = mode
            self._locked, self._lost = set(locked), None
        except BaseException as error:
            self._lost = self._say(error, Fmi2Status.error)

    @staticmethod
    def _fmu_state_to_bytes(state: Any) -> bytes:
        try:
            return pickle.dumps(state, protocol=5)
        except BaseException as error:
            return pickle.dumps(f"The state cannot be serialised: {error}")

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> Any:
        try:
            return pickle.loads(state)
        except BaseException as error:
            return f"The serialised state cannot be read: {error}"

    def to_xml(self, model_options: Mapping[str, Any] | None = None) -> Element:
        """The complete model description; it does not depend on the time of the build."""
        options = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True} | dict(model_options or {})
        root: Element = super().to_xml(options)
        describe_model(root)
        start = {name: self._buffer[where].tolist() for name, (_, where) in self.blocks.items()}
        add_variables(root, self._core.variables, start, self.at_start)
        return root
