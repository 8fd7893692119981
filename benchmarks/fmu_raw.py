"""FMUs by the C functions of FMI 2.0 alone: unpacked once, any number of instances, every status and message kept."""

import faulthandler
import time
from ctypes import byref, c_char, c_char_p, c_int, c_size_t, c_uint, c_void_p, cast
from pathlib import Path

import fmpy
import numpy as np
from fmpy import calloc, free
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

OK, WARNING, DISCARD, ERROR, FATAL = range(5)  # fmi2Status
CATEGORIES = {DISCARD: "logStatusDiscard", ERROR: "logStatusError"}
# Seconds after which a call is taken to hang. The slowest that ends is a first step that fails, of two solves of 600
# Newton iterations each: 4 s for the simple wings, 34 s for the inflatable ones, which have many scalars.
LIMIT, LIMIT_LARGE, LARGE = 20.0, 100.0, 1000
START = (("SetupExperiment", 0, 0.0, 0.0, 0, 0.0), ("EnterInitializationMode",), ("ExitInitializationMode",))
TYPES = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int32}


class Library:
    """The binary of an unpacked FMU and its variables; `blocks` holds type, causality and places of `name[i,j]`."""

    def __init__(self, folder):
        self.name = Path(folder).name
        self.description = fmpy.read_model_description(folder, validate=False)
        identifier = self.description.coSimulation.modelIdentifier
        self.guid = self.description.guid.encode()
        slave = FMU2Slave(guid=self.description.guid, modelIdentifier=identifier, unzipDirectory=str(folder))
        self.dll, self.free_library = slave.dll, slave.freeLibrary
        self.blocks, self.size = {}, len(self.description.modelVariables)
        self.limit = LIMIT_LARGE if self.size > LARGE else LIMIT
        for v in self.description.modelVariables:
            block = self.blocks.setdefault(v.name.partition("[")[0], (v.type, v.causality, []))
            block[2].append(v.valueReference)

    def places(self, *causalities, kind=None):
        """Value references of the blocks of these causalities, of one type if given."""
        of = [r for k, c, rs in self.blocks.values() if c in causalities and kind in (None, k) for r in rs]
        return np.array(of, np.uint32)


class Instance:
    """One instance. `log` holds (status, category, text) of the latest call, the text as it comes, a printf format."""

    def __init__(self, library, name="x"):
        self.library, self.dll, self.log = library, library.dll, []
        self.slowest, self.calls = (0.0, ""), 0
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._hear)
        self.callbacks.allocateMemory = type(self.callbacks.allocateMemory)(calloc)
        self.callbacks.freeMemory = type(self.callbacks.freeMemory)(free)
        self.pointer = self.dll.fmi2Instantiate(name.encode(), 1, library.guid, None, byref(self.callbacks), 0, 1)
        if not self.pointer:
            raise RuntimeError(f"{library.name} cannot be instantiated: {self.log}")

    def _hear(self, _environment, _instance, status, category, text):
        self.log.append((status, category, text))

    def call(self, name, *arguments):
        """The status of a call; a process in which it takes longer than its limit ends, and says where it was."""
        self.log.clear()
        faulthandler.dump_traceback_later(self.library.limit, exit=True)
        begin = time.perf_counter()
        status = getattr(self.dll, f"fmi2{name}")(self.pointer, *arguments)
        seconds = time.perf_counter() - begin
        faulthandler.cancel_dump_traceback_later()
        self.calls += 1
        self.slowest = max(self.slowest, (seconds, name))
        return status

    def get(self, kind, references):
        """Status and values."""
        values = np.zeros(len(references), TYPES[kind])
        return self._moved(f"Get{kind}", references, values), values

    def set(self, kind, references, values):
        """Status of setting values, an array of the memory type of `kind`."""
        return self._moved(f"Set{kind}", references, np.ascontiguousarray(values, TYPES[kind]))

    def _moved(self, name, references, values):
        function = getattr(self.dll, f"fmi2{name}")
        references = np.ascontiguousarray(references, np.uint32)
        pointers = (cast(a.ctypes.data, t) for a, t in zip((references, values), function.argtypes[1::2], strict=True))
        first, second = pointers
        return self.call(name, first, c_size_t(len(references)), second)

    def strings(self, verb, references):
        """Status of getting or setting String variables, of which there are none."""
        n = len(references)
        return self.call(f"{verb}String", (c_uint * n)(*references), c_size_t(n), (c_char_p * n)(*[b"%s"] * n))

    def values(self, *causalities):
        """All values of these causalities, as bytes."""
        parts = (self.get(kind, self.library.places(*causalities, kind=kind))[1] for kind in TYPES)
        return b"".join(part.tobytes() for part in parts)

    def initialise(self):
        """The worst status of the calls that lead to the first step."""
        return max(self.call(*given) for given in START)

    def step(self, time_=0.0, size=1.0):
        """Status of a step."""
        return self.call("DoStep", time_, size, 0)

    def saved(self):
        """Status, and the handle of a new state."""
        state = c_void_p()
        return self.call("GetFMUstate", byref(state)), state

    def serialised(self, state):
        """Status, and the bytes of a state."""
        size = c_size_t()
        status = self.call("SerializedFMUstateSize", state, byref(size))
        if status != OK:
            return status, b""
        data = (c_char * size.value)()
        return self.call("SerializeFMUstate", state, data, size), data.raw

    def read(self, content):
        """Status, and the handle of a state read from bytes."""
        state, data = c_void_p(), (c_char * (len(content) or 1)).from_buffer_copy(content or b"\0")
        return self.call("DeSerializeFMUstate", data, c_size_t(len(content)), byref(state)), state

    def log_only(self, logging, categories):
        """Status of fmi2SetDebugLogging."""
        n = len(categories)
        return self.call("SetDebugLogging", c_int(logging), c_size_t(n), (c_char_p * n)(*categories))

    def free(self):
        """Free the instance, with what it still holds."""
        self.dll.fmi2FreeInstance(self.pointer)
        self.pointer = None


def settled(instance: Instance, content, legal):
    """Bytes of the outputs after one step with legal inputs from the legal state that `content` is."""
    status, state = instance.read(content)
    status = max(status, instance.call("SetFMUstate", state))
    for kind, (references, values) in legal.items():
        status = max(status, instance.set(kind, references, values))
    status = max(status, instance.step(100.0, 1.0))
    if status != OK:
        raise RuntimeError(f"the legal state cannot be restored: {instance.log}")
    outputs = instance.values("output")
    instance.call("FreeFMUstate", byref(state))
    return outputs
