"""What the tests share: the command line of kitecosim, the FMUs it builds, and one instance of each."""

import subprocess
import sys

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave

SCENE = "v3_kite"  # or the folder of a scene of your own
WIND = 12.0  # m/s


def kitecosim(*arguments):
    """Run the command line; its output is shown where a test fails."""
    return subprocess.run(
        [sys.executable, "-m", "master", *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False
    )


@pytest.fixture(scope="session")
def fmus(tmp_path_factory):
    """Paths of the structural and the aerodynamic FMU."""
    folder = tmp_path_factory.mktemp("fmus")
    done = kitecosim("build", SCENE, "--out", folder, "--set", f"wind_speed={WIND}")
    assert done.returncode == 0, done.stderr
    return sorted(folder.glob("*_structural.fmu"))[0], sorted(folder.glob("*_aero.fmu"))[0]


class Instance:
    """An FMU that is ready to step; variables by the name of their block."""

    def __init__(self, path, folder):
        fmpy.extract(path, folder)
        description = fmpy.read_model_description(folder)
        self.references = {}
        for variable in description.modelVariables:
            self.references.setdefault(variable.name.partition("[")[0], []).append(variable.valueReference)
        self.fmu = FMU2Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=folder,
            instanceName=path.stem,
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def get(self, block):
        return self.fmu.getReal(self.references[block])

    def set(self, block, values):
        self.fmu.setReal(self.references[block], list(values))

    def end(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture
def structure(fmus, tmp_path):
    """An instance of the structural FMU."""
    instance = Instance(fmus[0], tmp_path / "structure")
    yield instance
    instance.end()


@pytest.fixture
def flow(fmus, tmp_path):
    """An instance of the aerodynamic FMU."""
    instance = Instance(fmus[1], tmp_path / "flow")
    yield instance
    instance.end()
