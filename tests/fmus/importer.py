"""An FMI 2.0 importer in a few lines of fmpy: every scalar by its own name, nothing known of blocks."""

import shutil
import sys
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy

ERROR = 3  # fmi2Status
LOGS = {}  # environment -> messages; fmpy's proxy keeps one logger for the process, so that this one serves all


@fmi2CallbackLoggerTYPE
def listen(environment, _instance, status, _category, text):
    """Keep what an FMU logs."""
    LOGS[environment].append((status, text.decode()))


# For a process that knows only fmpy: starts an instance of an FMU; it, value references by block, the folder.
START = """
import shutil, sys
import fmpy
from fmpy.fmi2 import FMU2Slave


def start(path):
    folder = fmpy.extract(path)
    description = fmpy.read_model_description(folder)
    slave = FMU2Slave(guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier,
                      unzipDirectory=folder, instanceName="x")
    slave.instantiate(loggingOn=True)
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    references = {}
    for variable in description.modelVariables:
        references.setdefault(variable.name.partition("[")[0], []).append(variable.valueReference)
    return slave, references, folder
"""


class Ending:
    """An instance `slave` of fmpy, of an FMU unpacked in `folder`; as a context it terminates, frees and removes."""

    @property
    def script(self):
        """The module of the class of the instance."""
        return sys.modules[(Path(self.folder) / "resources/slavemodule.txt").read_text()]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.slave.terminate()
        self.slave.freeInstance()
        shutil.rmtree(self.folder)


class Importer(Ending):
    """One instance of an FMU; `log` holds (status, message)."""

    def __init__(self, path, initialise=True):
        self.path, self.folder = path, fmpy.extract(path)
        self.description = fmpy.read_model_description(self.folder)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.types = {v.name: v.type for v in self.description.modelVariables}
        self.log = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger, self.callbacks.componentEnvironment = listen, len(LOGS) + 1
        LOGS[len(LOGS) + 1] = self.log
        addLoggerProxy(fmpy.fmi2.byref(self.callbacks))
        self.slave = FMU2Slave(
            guid=self.description.guid,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            unzipDirectory=self.folder,
        )
        self.slave.instantiate(callbacks=self.callbacks, loggingOn=True)
        self.slave.setupExperiment()
        self.slave.enterInitializationMode()
        if initialise:
            self.slave.exitInitializationMode()

    def names(self, block):
        return [name for name in self.references if name.partition("[")[0] == block]

    def set(self, **values):
        for name, value in values.items():
            names = self.names(name)
            given = list(value) if isinstance(value, list | tuple) else [value] * len(names)
            convert = float if self.types[names[0]] == "Real" else int
            self._of_type("set", names)([self.references[n] for n in names], [convert(x) for x in given])

    def refused(self, **values):
        """Set values that must be refused; the sentence that is logged."""
        count = len(self.log)
        with pytest.raises(FMICallException) as caught:
            self.set(**values)
        assert caught.value.status == ERROR
        ((status, sentence),) = self.log[count:]
        assert status == ERROR
        return sentence

    def get(self, block):
        names = self.names(block)
        return [float(x) for x in self._of_type("get", names)([self.references[name] for name in names])]

    def _of_type(self, verb, names):
        """The function of the slave for the type that the scalars of a block have."""
        return getattr(self.slave, verb + self.types[names[0]])
