"""A co-simulation FMU of FMI 2.0 or 3.0 as a participant.

An FMU's scalars `name[i,j]` are grouped into blocks, and every exchange is one C call a block on prebuilt arrays.
"""

import contextlib
import errno
import functools
import itertools
import os
import time
import weakref
import zipfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from ctypes import byref, c_char, c_char_p, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import calloc, extract, free, platform, platform_tuple, read_model_description
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy

from master.coupling.participants.blocks import Blocks, Channel, described_limits, grouped
from master.coupling.participants.ended_steps import failure, finished
from master.coupling.participants.fmi3 import Fmi3Library, scalars_of
from master.coupling.participants.private_folder import PrivateFolder

# fmpy's proxy, which formats what FMUs log, has one callback in a process: ours is made current before every call and
# lives for ever. What arrives during a call is of the participant that is called: many FMUs hand on a pointer of their
# own, or none, instead of the environment they were given. That counts only between calls (threads of an FMU).
_LISTENERS: "weakref.WeakValueDictionary[int, FmuParticipant]" = weakref.WeakValueDictionary()
_NUMBERS = itertools.count(1)
_CALLED: "list[FmuParticipant]" = []  # the last one is called now
_NAMES: "weakref.WeakValueDictionary[str, FmuParticipant]" = weakref.WeakValueDictionary()  # of living instances


def _hear(environment: int, _instance: bytes, status: int, _category: bytes, message: bytes) -> None:
    participant = _CALLED[-1] if _CALLED else _LISTENERS.get(environment)
    try:
        if participant is not None and message is not None:
            participant.hear(status, message.decode("utf-8", "replace"))
    except KeyboardInterrupt:  # C cannot hand it on
        if participant is not None:
            participant.interrupted = True


_LOGGER = fmi2CallbackLoggerTYPE(_hear)
_PROXIED = fmi2CallbackFunctions()
_PROXIED_POINTER = byref(_PROXIED)
WATCH: Callable[[str], Any] | None = None  # is told which instance is called, "" behind a call
LARGEST = 4 * 2**30  # bytes of an FMU that is unpacked
ALARMS = 20  # different errors in calls that succeeded which are kept
OURS = "kitecosim"  # how the tool that made our FMUs is called
_WARNING, _DISCARD, _ERROR, _FATAL = 1, 2, 3, 4  # fmi2Status


def _needed(path: str) -> bool:
    """Whether a file of an FMU is of use here: the binaries of other platforms are not."""
    here = f"binaries/{platform}/", f"binaries/{platform_tuple}/"  # of FMI 2.0 and 3.0
    return not path.startswith("binaries/") or path.startswith(here)


def require_size(path: str | Path) -> None:
    """ValueError in one sentence for an FMU that is larger than LARGEST when it is unpacked: a few kB can be made to
    fill any disk. zipfile takes no more of an entry than it declares.
    """
    with zipfile.ZipFile(path) as file:
        size = sum(entry.file_size for entry in file.infolist() if _needed(entry.filename))
    if size > LARGEST:
        raise ValueError(f"it takes {size / 2**30:.3g} GiB unpacked, more than {LARGEST / 2**30:g}")


class FMU2Sparse(FMU2Slave):  # fmpy tells the version of FMI by the first letters of the name
    """A library that may lack functions that nothing here needs of it, or only where a capability is declared."""

    NEEDED = ("Instantiate", "FreeInstance", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode",
              "DoStep", "GetReal", "SetReal")  # fmt: skip

    def _loadFunctions(self) -> None:
        for name in dir(self):
            if name.startswith("fmi2") and name[4:] not in self.NEEDED and not hasattr(self.dll, name):
                setattr(self.dll, name, lambda *_: _ERROR)
        super()._loadFunctions()


class FmuParticipant(Blocks):
    """Any co-simulation FMU of FMI 2.0 or 3.0, initialised and ready to step; use it as a context manager or close it.

    `parameters` (block -> value) are start values of parameters and inputs, `texts` those of String variables. `named`
    makes blocks beside those of `name[i,j]` (`own_blocks`): name -> (variables in row-major order, shape). `instance`
    is the name of the instance, unique as FMI asks; by default that of the model, with a number if it is taken. What
    the FMU logs is kept, not printed: `messages` holds the last (status, sentence) pairs, `alarms` the errors that it
    logged in calls that succeeded. `initialisation_s` is the time that its initialisation took, in which an FMU
    computes its outputs for the first time; with `initialise` False that is left to `enter_initialization` and
    `exit_initialization`, and inputs can be set between the two. `known` are its model description and its scalars,
    where they were read before.
    """

    def __init__(
        self,
        path: str | Path,
        parameters: Mapping[str, Any] | None = None,
        start_time: float = 0.0,
        stop_time: float | None = None,
        named: Mapping[str, tuple[Sequence[str], tuple[int, ...]]] | None = None,
        texts: Mapping[str, str] | None = None,
        instance: str | None = None,
        initialise: bool = True,
        known: tuple[Any, list[Any]] | None = None,
    ) -> None:
        self.name, self.instance = Path(path).name, instance
        self.messages: deque[tuple[int, str]] = deque(maxlen=50)
        self.alarms: dict[str, None] = {}
        self.outside: dict[str, float] = {}
        self._times = start_time, stop_time
        if not Path(path).is_file():
            raise ValueError(f"There is no FMU {path}.")
        self._private = PrivateFolder()
        self._folder = str(self._private.path)
        self._states: dict[int | None, c_void_p] = {}
        self._initialised = self.interrupted = False
        self._fmu: Any = None  # of fmpy, while it is alive
        self._end = "is closed."
        try:
            self._load(path, named or {}, known)
            for block, value in (parameters or {}).items():
                self._put(block, self.checked(block, value, start=True))
            for name, text in (texts or {}).items():
                reference, value = (c_uint * 1)(self._texts[name]), (c_char_p * 1)(text.encode())
                self._require(self._alive().fmi2SetString, self._component, reference, 1, value)
            if initialise:
                self.enter_initialization()
                self.exit_initialization()
        except BaseException:
            self.close()
            raise

    def enter_initialization(self) -> None:
        """Into initialization mode, with the start values that were given."""
        dll, (start, stop) = self._alive(), self._times
        begin = time.perf_counter()
        self._require(dll.fmi2SetupExperiment, self._component, 0, 0.0, start, stop is not None, stop or 0.0)
        self._require(dll.fmi2EnterInitializationMode, self._component)
        self.initialisation_s = time.perf_counter() - begin

    def exit_initialization(self) -> None:
        """Out of initialization mode: ready to step."""
        begin = time.perf_counter()
        self._require(self._alive().fmi2ExitInitializationMode, self._component)
        self.initialisation_s += time.perf_counter() - begin
        if isinstance(self._fmu, Fmi3Library):
            self._channels.clear()
        self._initialised = True

    def _load(
        self,
        path: str | Path,
        named: Mapping[str, tuple[Sequence[str], tuple[int, ...]]],
        known: tuple[Any, list[Any]] | None,
    ) -> None:
        """Unpack, describe and instantiate."""
        try:
            require_size(path)
            extract(str(path), self._folder, include=_needed)
            description = known[0] if known is not None else read_model_description(self._folder, validate=False)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
                why = str(error.strerror).lower()
                raise ValueError(f"{path} cannot be unpacked in {self._folder} ({why}); make room there.") from error
            raise ValueError(f"{path} is not a readable FMU: {error}") from error
        except Exception as error:
            raise ValueError(f"{path} is not a readable FMU: {error}") from error
        if not description.fmiVersion.startswith(("2.", "3.")) or description.coSimulation is None:
            raise ValueError(f"{path} is not a co-simulation FMU of FMI 2.0 or 3.0.")
        self.guid = str(description.guid)
        self._ours = str(description.generationTool).startswith(OURS)
        self.saves_state = bool(description.coSimulation.canGetAndSetFMUstate)
        self.serialises_state = self.saves_state and bool(description.coSimulation.canSerializeFMUstate)
        scalars = known[1] if known is not None else scalars_of(description, self._folder)
        variables = {variable.name: variable for variable in scalars}
        self._texts = {name: v.valueReference for name, v in variables.items() if v.type == "String"}
        self._scalars = grouped(scalars)
        self.own_blocks = {name: shape for name, (_, shape) in self._scalars.items()}
        self._scalars |= {name: ([variables[v] for v in listed], shape) for name, (listed, shape) in named.items()}
        self.blocks = {name: shape for name, (_, shape) in self._scalars.items()}
        self.limits = {name: described_limits(*block) for name, block in self._scalars.items()}
        self._channels: dict[str, Channel] = {}
        callbacks = fmi2CallbackFunctions()
        callbacks.logger, callbacks.componentEnvironment = _LOGGER, next(_NUMBERS)
        callbacks.allocateMemory = type(callbacks.allocateMemory)(calloc)
        callbacks.freeMemory = type(callbacks.freeMemory)(free)
        addLoggerProxy(byref(callbacks))
        _LISTENERS[callbacks.componentEnvironment] = self
        self._worst, self._reason = 0, ""
        before = os.getcwd()
        try:
            where = {"modelIdentifier": description.coSimulation.modelIdentifier, "unzipDirectory": self._folder}
            where["instanceName"] = self._named(description.coSimulation.modelIdentifier)
            where["guid"] = description.guid
            three = description.fmiVersion.startswith("3.")
            fmu = Fmi3Library(scalars, self._hear, **where) if three else FMU2Sparse(requireFunctions=False, **where)
            with self._called():
                fmu.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:
            why = " ".join((self._reason or str(error)).split())
            raise ValueError(f"{path} cannot be instantiated: {why}") from error
        finally:
            os.chdir(before)  # fmpy leaves the working directory when a library does not load
        self._fmu, self._component = fmu, fmu.component
        self._step = fmu.dll.fmi2DoStep
        # PythonFMU, and our binary, say fmi2Terminated of every step that was not made
        self._terminates = not (self._ours or hasattr(fmu.dll, "finalizePythonInterpreter"))

    def _named(self, model: str) -> str:
        """The name of the instance, which is taken from now on."""
        if self.instance is None:
            free = (name for k in itertools.count(1) if (name := model if k == 1 else f"{model}_{k}") not in _NAMES)
            self.instance = next(free)
        _NAMES[self.instance] = self
        return self.instance

    @contextlib.contextmanager
    def _called(self) -> Iterator[None]:
        """What is logged meanwhile is of this participant."""
        _CALLED.append(self)
        if WATCH is not None:
            WATCH(self.instance or "")
        try:
            yield
        finally:
            _CALLED.pop()
            if WATCH is not None:
                WATCH("")

    def _hear(self, status: int, message: bytes) -> None:
        try:
            self.hear(status, message.decode("utf-8", "replace"))
        except KeyboardInterrupt:  # C cannot hand it on
            self.interrupted = True

    def hear(self, status: int, message: str) -> None:
        """Take a message of the FMU."""
        self.messages.append((status, message))
        if status >= self._worst:
            self._worst, self._reason = status, message

    def _alive(self) -> Any:
        """The C functions."""
        if self._fmu is None:
            raise ValueError(f"{self.name} {self._end}")
        return self._fmu.dll

    def _call(self, function: Any, *arguments: Any) -> int:
        """Status of a C call; `_reason` is then the worst of what the FMU logged meanwhile."""
        self._alive()
        self._worst, self._reason = 0, ""
        _PROXIED.logger = _LOGGER
        addLoggerProxy(_PROXIED_POINTER)
        _CALLED.append(self)
        if WATCH is not None:
            WATCH(self.instance or "")
        try:
            status: int = function(*arguments)
        finally:
            _CALLED.pop()
            if WATCH is not None:
                WATCH("")
        if status == _FATAL:
            version = 2
            if isinstance(self._fmu, Fmi3Library):
                version = 3
                self._fmu.keep()
            self._fmu = None  # no further call is allowed, not even the one that frees it
            self._end = f"ended with fmi{version}Fatal: {self._reason or 'no reason logged'}"
            raise RuntimeError(f"{self.name} {self._end}")
        if self.interrupted or self._reason.startswith("KeyboardInterrupt"):  # in code of Python that the FMU runs
            self.interrupted = False
            raise KeyboardInterrupt
        return status

    def _require(self, function: Any, *arguments: Any) -> None:
        """A call that has to succeed. Errors that are logged in calls that succeed are kept as `alarms`; but where an
        FMU of ours runs in PythonFMU's binary, which has no status for them but fmi2Fatal, they count.
        """
        status = self._call(function, *arguments)
        if status > _WARNING or (self._worst > _DISCARD and self._ours):
            raise ValueError(f"{self.name}: {self._reason or f'status {status} of {function.__name__}'}")
        if self._worst > _DISCARD:
            self._alarm()

    def _alarm(self) -> None:
        """Keep an error that was logged in a call that succeeded."""
        if len(self.alarms) < ALARMS:
            self.alarms[self._reason] = None

    def _channel(self, block: str) -> Channel:
        channel = self._channels.get(block)
        if channel is None:
            self.shape(block)
            make = getattr(self._fmu, "channel", None) or functools.partial(Channel, self._alive())
            channel = self._channels[block] = make(self._component, *self._scalars[block])
        return channel

    def _put(self, block: str, array: np.ndarray) -> None:
        channel = self._channel(block)
        channel.values[...] = array
        if not np.array_equal(channel.values, array):
            raise ValueError(f"{self.name}: block {block!r} takes whole numbers of {8 * channel.values.itemsize} bits.")
        self._require(channel.set_, *channel.arguments)

    def set(self, block: str, values: Any) -> None:
        """See Participant."""
        self._put(block, self.checked(block, values))

    def receive(self, block: str, values: Any) -> None:
        """Take what a source sends: as `set`, but a value at a bound may be outside by rounding, and what lies farther
        outside is left to the FMU to judge.
        """
        self._put(block, self.arriving(block, values))

    def step(self, t: float, dt: float) -> None:
        """See Participant; `SimulationEnded` where the FMU asks for the end, `StepDiscarded` where it refuses."""
        status = self._call(self._step, self._component, t, dt, not self.saves_state)
        if status > _WARNING:
            with self._called():
                ended = finished(self._fmu.dll, self._component, status)
                if ended > _WARNING:
                    told, dll = self._told(), self._fmu.dll
                    raise failure(dll, self._component, ended, (t, dt), told, self._terminates)
        if self._worst > _DISCARD:
            self._alarm()

    def _told(self) -> str:
        """What the FMU logged as the reason of a failure; nothing where that is mere information."""
        return self._reason if self._worst >= _WARNING else ""

    def get(self, block: str) -> np.ndarray:
        """See Participant."""
        channel = self._channel(block)
        self._require(channel.get_, *channel.arguments)
        return channel.values.astype(float)

    def save(self) -> c_void_p:
        """See Participant."""
        if not self.saves_state:
            raise ValueError(f"{self.name} cannot save its state: its canGetAndSetFMUstate is false.")
        state = c_void_p()
        self._require(self._alive().fmi2GetFMUstate, self._component, byref(state))
        self._states[state.value] = state
        return state

    def restore(self, state: c_void_p) -> None:
        """See Participant."""
        if state.value not in self._states:
            raise ValueError(f"{self.name}: the state is not one of its own, or was freed.")
        self._require(self._alive().fmi2SetFMUstate, self._component, state)

    def free(self, state: c_void_p) -> None:
        """See Participant."""
        if self._states.pop(state.value, None) is not None:
            self._require(self._alive().fmi2FreeFMUstate, self._component, byref(state))
            state.value = None

    def serialised(self, state: c_void_p) -> bytes:
        """See Participant."""
        self._require_serialisation()
        size = c_size_t()
        self._require(self._alive().fmi2SerializedFMUstateSize, self._component, state, byref(size))
        data = (c_char * size.value)()
        self._require(self._alive().fmi2SerializeFMUstate, self._component, state, data, size)
        return data.raw

    def deserialised(self, data: bytes) -> c_void_p:
        """See Participant."""
        self._require_serialisation()
        state, buffer = c_void_p(), (c_char * len(data)).from_buffer_copy(data)
        self._require(self._alive().fmi2DeSerializeFMUstate, self._component, buffer, len(data), byref(state))
        self._states[state.value] = state
        return state

    def _require_serialisation(self) -> None:
        if not self.serialises_state:
            raise ValueError(f"{self.name} cannot write its state to a file: its canSerializeFMUstate is false.")

    def close(self) -> None:
        """Free the saved states, terminate, free the instance and remove the unpacked folder; once is enough."""
        with contextlib.suppress(ValueError, RuntimeError):
            for state in list(self._states.values()):
                self.free(state)
            if self._initialised:
                self._call(self._alive().fmi2Terminate, self._component)
        if self._fmu is not None:
            with self._called():
                self._fmu.fmi2FreeInstance(self._component)
                with contextlib.suppress(AttributeError):
                    self._fmu.dll.finalizePythonInterpreter()  # PythonFMU, left to itself, can corrupt memory at exit
                self._fmu.freeLibrary()
        self._fmu = None
        if _NAMES.get(self.instance or "") is self:
            del _NAMES[self.instance or ""]
        self._private.close()
