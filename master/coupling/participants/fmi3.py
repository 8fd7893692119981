"""FMUs of FMI 3.0 as a participant of FMI 2.0 sees them: scalars instead of arrays, and the C calls that it makes.

An array is described as its entries `name[i,j]`, counted from 1, which make a block as those of FMI 2.0 do. Every
exchange of a whole Float64 array is one C call; other types are converted, and an entry alone is set within its array
as that stands.
"""

import contextlib
import ctypes
import functools
import zipfile
from collections.abc import Callable, Sequence
from ctypes import POINTER, byref, c_bool, c_char_p, c_double, c_int, c_uint, c_uint8
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from fmpy.fmi3 import FMU3Slave, fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from master.coupling.participants.ended_steps import DISCARD, ERROR, LAST_SUCCESSFUL_TIME, OK, TERMINATED, WARNING

# Type of FMI 3.0 -> (type of FMI 2.0 that it is described as, functions that carry it, its memory).
TYPES = {
    "Float64": ("Real", "Float64", np.float64),
    "Float32": ("Real", "Float32", np.float32),
    **{name: ("Integer", name, getattr(np, name.lower())) for name in ("Int8", "Int16", "Int32", "Int64")},
    **{name: ("Integer", name, getattr(np, name.lower())) for name in ("UInt8", "UInt16", "UInt32", "UInt64")},
    "Boolean": ("Boolean", "Boolean", np.bool_),
    "Enumeration": ("Enumeration", "Int64", np.int64),
}
LARGEST_WHOLE = 2**53  # beyond it not every whole number is a double
_CALLBACKS: list[Any] = []  # of FMUs that ended with fmi3Fatal: their library stays, and may log for ever


class Entry:
    """An entry of an array of FMI 3.0, or a variable that is none, described as a scalar of FMI 2.0.

    `array` is the variable, `place` the number of the entry in it, `valueReference` its number among all entries; what
    is not its own is that of the variable.
    """

    valueReference: int

    def __init__(self, array: Any, name: str, kind: str, place: int = 0, **own: Any) -> None:
        self.array, self.name, self.type, self.place = array, name, kind, place
        self.__dict__ |= own

    def __getattr__(self, name: str) -> Any:
        if "array" not in self.__dict__:  # while it is copied
            raise AttributeError(name)
        return getattr(self.array, name)


def scalars_of(description: Any, path: str | Path) -> list[Any]:
    """The variables of an FMU as scalars of FMI 2.0: those of fmpy, or entries of FMI 3.0.

    `path` is the FMU or its folder.
    """
    if not description.fmiVersion.startswith("3"):
        return list(description.modelVariables)
    bounds = _unsigned_bounds(description, path)
    found: list[Entry] = []
    for variable in description.modelVariables:
        found += _entries(variable, bounds.get((variable.alias or variable).name, (variable.min, variable.max)))
    for number, entry in enumerate(found):
        entry.valueReference = number
    return found


def _unsigned_bounds(description: Any, path: str | Path) -> dict[str, tuple[str | None, str | None]]:
    """Least and greatest value of variables of types UInt8 to UInt64, which fmpy does not read."""
    if not any(v.type.startswith("UInt") for v in description.modelVariables):
        return {}
    with contextlib.ExitStack() as stack:
        if Path(path).is_dir():
            file: Any = stack.enter_context((Path(path) / "modelDescription.xml").open("rb"))
        else:
            file = stack.enter_context(stack.enter_context(zipfile.ZipFile(path)).open("modelDescription.xml"))
        variables = ElementTree.parse(file).getroot().find("ModelVariables")
    listed: Any = [] if variables is None else variables
    return {v.get("name", ""): (v.get("min"), v.get("max")) for v in listed if v.tag.startswith("UInt")}


def _entries(variable: Any, bounds: tuple[str | None, str | None]) -> list[Entry]:
    """The scalars of a variable; fmpy lists aliases as variables."""
    name, shape = variable.name, tuple(variable.shape or ())
    if variable.clocks:
        return [Entry(variable, name, "Clocked")]
    if variable.type not in TYPES:  # texts, binary data, clocks
        return [Entry(variable, name, "Texts" if variable.type == "String" and shape else variable.type)]
    kind = TYPES[variable.type][0]
    low, high = _bounds(variable, bounds)
    # the sizes of arrays are those of the model description, so structural parameters take no start value
    initial = None if variable.causality == "structuralParameter" else variable.initial
    own = {"min": low, "max": high, "initial": initial}
    if not shape:
        return [Entry(variable, name, kind, **own)]
    starts = (variable.start or "").split()
    starts += [None] * (int(np.prod(shape)) - len(starts))
    return [
        Entry(variable, f"{name}[{','.join(str(i + 1) for i in index)}]", kind, place, start=starts[place], **own)
        for place, index in enumerate(np.ndindex(shape))
    ]


def _bounds(variable: Any, given: tuple[str | None, str | None]) -> tuple[Any, Any]:
    """Bounds of a variable: its own, those of its declared type, or those of what its memory holds."""
    declared = variable.declaredType
    low, high = (
        own if own is not None or declared is None else of_type
        for own, of_type in zip(given, (getattr(declared, "min", None), getattr(declared, "max", None)), strict=True)
    )
    memory = TYPES[variable.type][2]
    if variable.type in ("Float64", "Boolean", "Enumeration"):
        return low, high
    about: Any = np.finfo(memory) if memory is np.float32 else np.iinfo(memory)
    least, most = max(about.min, -LARGEST_WHOLE), min(about.max, LARGEST_WHOLE)
    if memory is np.float32:
        least, most = about.min, about.max
    return least if low is None else low, most if high is None else high


class FMU3Sparse(FMU3Slave):
    """A library that may lack functions that nothing here needs of it, or only where a capability is declared."""

    NEEDED = ("InstantiateCoSimulation", "FreeInstance", "EnterInitializationMode", "ExitInitializationMode", "DoStep",
              "GetFloat64", "SetFloat64")  # fmt: skip

    def _loadFunctions(self) -> None:
        for name in dir(self):
            if name.startswith("fmi3") and name[4:] not in self.NEEDED and not hasattr(self.dll, name):
                setattr(self.dll, name, lambda *_: ERROR)
        super()._loadFunctions()


class Fmi3Library:
    """The C functions that a participant calls of an FMU of FMI 2.0, of one of FMI 3.0.

    `hear` takes (status, sentence) of what the FMU logs. Clocks and events are left to the FMU: it is instantiated
    without event mode and without early return.
    """

    def __init__(self, entries: Sequence[Any], hear: Callable[[int, bytes], None], **where: Any) -> None:
        self._fmu = FMU3Sparse(requireFunctions=False, **where)
        self._entries = entries
        self._hear = hear
        self._times: tuple[Any, ...] = ()
        self._started: dict[int, np.ndarray] | None = {}  # arrays as set so far, until the FMU can be asked
        self._last, self._terminated = 0.0, False
        self.component: Any = None

    @property
    def dll(self) -> "Fmi3Library":
        """Where the functions are."""
        return self

    def instantiate(self, callbacks: Any = None, loggingOn: bool = True) -> None:
        """See fmpy; `callbacks` are of FMI 2.0, and nothing of them is used."""
        self._logger = fmi3LogMessageCallback(lambda _, status, __, text: self._hear(status, text or b""))
        self._fmu.intermediateUpdate = fmi3IntermediateUpdateCallback()
        resources = str(Path(self._fmu.unzipDirectory, "resources")) + "/"
        made = self._fmu.dll.fmi3InstantiateCoSimulation(
            *(self._fmu.instanceName.encode(), self._fmu.guid.encode(), resources.encode()),
            *(False, loggingOn, False, False, None, 0, None, self._logger, self._fmu.intermediateUpdate),
        )
        if not made:
            raise RuntimeError("fmi3InstantiateCoSimulation returned no instance")
        self.component = made

    def channel(self, component: Any, entries: Sequence[Any], shape: tuple[int, ...]) -> "Fmi3Channel":
        """The memory of a block."""
        return Fmi3Channel(self._fmu.dll, component, entries, shape, self._present, direct=self._started is None)

    def _present(self, array: Any, get: Callable[[], int], buffer: np.ndarray, whole: bool) -> int:
        """Fill a buffer with an array as it stands, before entries of it are set; the status."""
        if self._started is None:
            return OK if whole else get()
        if array.valueReference not in self._started:
            texts = (array.start or "").split()
            begun = np.zeros_like(buffer)
            if len(texts) == begun.size:
                begun[...] = [_value(text, begun.dtype) for text in texts]
            self._started[array.valueReference] = begun
        buffer[...] = self._started[array.valueReference]
        self._started[array.valueReference] = buffer  # which is what it is set to next
        return OK

    def fmi2SetString(self, component: Any, references: Any, count: int, values: Any) -> int:
        """See FMI 2.0."""
        status = OK
        for reference, value in zip(references[:count], values[:count], strict=True):
            own = (c_uint * 1)(self._entries[reference].array.valueReference)
            status = max(status, self._fmu.dll.fmi3SetString(component, own, 1, (c_char_p * 1)(value), 1))
        return status

    def fmi2SetupExperiment(self, component: Any, *times: Any) -> int:
        """See FMI 2.0; the times go to the FMU with the next call."""
        self._times = times
        return OK

    def fmi2EnterInitializationMode(self, component: Any) -> int:
        """See FMI 2.0."""
        status: int = self._fmu.dll.fmi3EnterInitializationMode(component, *self._times)
        self._started = None
        return status

    def fmi2ExitInitializationMode(self, component: Any) -> int:
        """See FMI 2.0."""
        status: int = self._fmu.dll.fmi3ExitInitializationMode(component)
        return status

    def fmi2DoStep(self, component: Any, time: float, step: float, no_state_before: bool) -> int:
        """See FMI 2.0: a step that asks for the end of the simulation, or returns early, is a discarded one."""
        event, terminate, early, last = c_bool(), c_bool(), c_bool(), c_double(time)
        told = byref(event), byref(terminate), byref(early), byref(last)
        status: int = self._fmu.dll.fmi3DoStep(component, time, step, no_state_before, *told)
        self._last, self._terminated = last.value, terminate.value
        if status > WARNING or not (terminate.value or early.value):
            return status
        what = (
            "asks for the end of the simulation" if terminate.value else "returned early, though that was not allowed,"
        )
        self._hear(DISCARD, f"the step from {time:g} s {what} at {last.value:g} s".encode())
        return DISCARD

    def fmi2GetRealStatus(self, component: Any, kind: int, value: Any) -> int:
        """See FMI 2.0."""
        if kind != LAST_SUCCESSFUL_TIME:
            return DISCARD
        ctypes.cast(value, POINTER(c_double))[0] = self._last
        return OK

    def fmi2GetBooleanStatus(self, component: Any, kind: int, value: Any) -> int:
        """See FMI 2.0."""
        if kind != TERMINATED:
            return DISCARD
        ctypes.cast(value, POINTER(c_int))[0] = self._terminated
        return OK

    def fmi2SerializeFMUstate(self, component: Any, state: Any, data: Any, size: Any) -> int:
        """See FMI 2.0."""
        status: int = self._fmu.dll.fmi3SerializeFMUState(component, state, ctypes.cast(data, POINTER(c_uint8)), size)
        return status

    def fmi2DeSerializeFMUstate(self, component: Any, data: Any, size: Any, state: Any) -> int:
        """See FMI 2.0."""
        data = ctypes.cast(data, POINTER(c_uint8))
        status: int = self._fmu.dll.fmi3DeserializeFMUState(component, data, size, state)
        return status

    def __getattr__(self, name: str) -> Any:
        """Functions whose arguments are the same in FMI 3.0."""
        there = SAME.get(name)
        if there is None:
            raise AttributeError(name)
        return getattr(self._fmu.dll, there)

    def fmi2FreeInstance(self, component: Any) -> None:
        """See FMI 2.0."""
        self._fmu.dll.fmi3FreeInstance(component)

    def freeLibrary(self) -> None:
        """See fmpy."""
        self._fmu.freeLibrary()

    def keep(self) -> None:
        """Let the library call back for ever: it ended with fmi3Fatal and is not unloaded."""
        _CALLBACKS.append(self._logger)


SAME = {
    "fmi2GetFMUstate": "fmi3GetFMUState",
    "fmi2SetFMUstate": "fmi3SetFMUState",
    "fmi2FreeFMUstate": "fmi3FreeFMUState",
    "fmi2SerializedFMUstateSize": "fmi3SerializedFMUStateSize",
    "fmi2Terminate": "fmi3Terminate",
    "finalizePythonInterpreter": "finalizePythonInterpreter",  # of PythonFMU, see FmuParticipant.close
}


def _value(text: str, dtype: Any) -> Any:
    return text in ("true", "1") if dtype == np.bool_ else dtype.type(text)


class Fmi3Channel:
    """The C arrays of one block, see Channel: `values` holds doubles, or Int64 where there are only whole numbers."""

    def __init__(
        self,
        dll: Any,
        component: Any,
        entries: Sequence[Any],
        shape: tuple[int, ...],
        present: Callable[..., int],
        direct: bool,
    ) -> None:
        real = any(entry.type == "Real" for entry in entries)
        self.values = np.zeros(shape, dtype=np.float64 if real else np.int64)
        places: dict[int, list[tuple[int, Any]]] = {}
        for k, entry in enumerate(entries):
            places.setdefault(entry.array.valueReference, []).append((k, entry))
        self._parts = [_Part(dll, component, listed, present) for listed in places.values()]
        one = self._parts[0]
        self.arguments: tuple[Any, ...] = ()
        if direct and len(self._parts) == 1 and one.whole and one.name == "Float64":
            self.values = one.buffer.reshape(shape)  # no copies
            self.set_, self.get_, self.arguments = one.set_, one.get_, one.arguments
        else:
            self.set_, self.get_ = named(f"fmi3Set{one.name}", self._set), named(f"fmi3Get{one.name}", self._get)

    def _set(self) -> int:
        flat, status = self.values.reshape(-1), OK
        for part in self._parts:
            status = max(status, part.set(flat))
        return status

    def _get(self) -> int:
        flat, status = self.values.reshape(-1), OK
        for part in self._parts:
            status = max(status, part.get(flat))
        return status


class _Part:
    """One array of the FMU, of which a block holds some entries: all of them in their order if `whole`."""

    def __init__(
        self, dll: Any, component: Any, listed: Sequence[tuple[int, Any]], present: Callable[..., int]
    ) -> None:
        self.array = listed[0][1].array
        size = int(np.prod(self.array.shape or (), dtype=int))
        self.name, memory = TYPES[self.array.type][1:]
        self.buffer = np.zeros(size, dtype=memory)
        self._from = np.array([k for k, _ in listed])
        self._to = np.array([entry.place for _, entry in listed])
        self._every = len(set(self._to.tolist())) == size
        self.whole = np.array_equal(self._to, np.arange(size)) and np.array_equal(self._from, self._to)
        self.set_, self.get_ = getattr(dll, f"fmi3Set{self.name}"), getattr(dll, f"fmi3Get{self.name}")
        reference = (c_uint * 1)(self.array.valueReference)
        pointer = ctypes.cast(self.buffer.ctypes.data, self.get_.argtypes[3])
        self.arguments = component, reference, 1, pointer, size
        self._present = functools.partial(present, self.array, self._read, self.buffer, self._every)

    def _read(self) -> int:
        status: int = self.get_(*self.arguments)
        return status

    def set(self, flat: np.ndarray) -> int:
        """Set the entries from the values of the block; the status."""
        status: int = self._present()
        if status > WARNING:
            return status
        self.buffer[self._to] = flat[self._from]
        status = self.set_(*self.arguments)
        return status

    def get(self, flat: np.ndarray) -> int:
        """Put the entries into the values of the block; the status. ValueError for one that no double holds."""
        status = self._read()
        values = self.buffer[self._to]
        if self.buffer.dtype.kind in "iu" and self.buffer.dtype.itemsize == 8:
            beyond = (values > LARGEST_WHOLE) | (values < -LARGEST_WHOLE if self.buffer.dtype.kind == "i" else False)
            if beyond.any():
                raise ValueError(
                    f"'{self.array.name}' holds {int(values[beyond][0])}, beyond 2^53, where whole numbers "
                    "are not exact here; keep it smaller."
                )
        flat[self._from] = values
        return status


def named(name: str, function: Callable[[], int]) -> Callable[[], int]:
    """A function under the name that messages give it."""

    def call() -> int:
        return function()

    call.__name__ = name
    return call
