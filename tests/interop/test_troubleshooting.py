"""The table of troubles on the page quotes what is really said: every message is provoked."""

import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.interop import test_parameters
from tests.interop.c_host import environment
from tests.interop.tools import PAGE, Row, program

ROW = re.compile(r"^\| `([^`]+)` \|[^|]+\|[^|]+\|$", re.MULTILINE)

REFUSED = """
import fmpy
from fmpy.fmi2 import FMU2Slave
from kite_pair import DESCRIPTIONS, FMUS, REFERENCES

description = DESCRIPTIONS["aero"]
slave = FMU2Slave(
    guid=GUID,
    unzipDirectory=fmpy.extract(FMUS["aero"]),
    modelIdentifier=description.coSimulation.modelIdentifier,
    instanceName="aero",
)
slave.instantiate()
slave.setupExperiment(startTime=0.0)
slave.enterInitializationMode()
slave.exitInitializationMode()
for call, *arguments in ((slave.setReal, [REFERENCES["aero"]["wind_speed"]], [-1.0]), (slave.doStep, 0.0, 1.0)):
    try:
        call(*arguments)
    except Exception as error:
        print(error)
"""


class Provoked:
    """What is said in each case of the table."""

    def __init__(self, request, shell, folder):
        self.request, self.shell, self.folder = request, shell, folder

    def _script(self, text):
        done = program([sys.executable, "-c", text], self.shell.folder)
        return done.stdout + done.stderr

    def _hosted(self, binary, place):
        host, wired = map(self.request.getfixturevalue, ("host", "wired"))
        done = program([str(host), str(wired[binary])], self.folder, place)
        return done.stdout + done.stderr

    def libtbb_is_missing(self):
        """The library of Ecos with another name of what it needs, as the real one may be installed."""
        Row().of_package("ecospy", "ecospy", "")
        copy = self.folder / "libecosc.so"
        (package,) = find_spec("ecospy").submodule_search_locations
        copy.write_bytes(
            (Path(package) / "binaries/libecosc.so").read_bytes().replace(b"libtbb.so.12", b"libtbb.so.00")
        )
        return self._script(f"import ctypes; ctypes.CDLL({str(copy)!r})").replace("libtbb.so.00", "libtbb.so.12")

    def python_has_no_numpy(self):
        bare = self.folder / "bare"
        done = program([sys.executable, "-m", "venv", "--without-pip", str(bare)], self.folder)
        assert done.returncode == 0, done.stderr
        return self._hosted("own", {"PATH": str(bare / "bin")})

    def python_is_missing(self):
        return self._hosted("own", {"PATH": str(self.folder)})

    def pythonfmu_s_binary_in_c(self):
        return self._hosted("PythonFMU", environment("host-env"))

    def scipy_is_missing(self):
        """A Python with everything that is installed but scipy and this project, seen by links."""
        place = self.folder / "packages"
        place.mkdir()
        for name in Path(find_spec("numpy").origin).parents[1].iterdir():
            if not name.name.startswith(("scipy", "__")) and name.suffix != ".pth":
                (place / name.name).symlink_to(name)
        path = {**os.environ, "PYTHONPATH": str(place)}
        done = program(
            [sys.executable, "-S", "-c", test_parameters.FMPY.replace("WIND", "11.0")], self.shell.folder, path
        )
        return done.stdout + done.stderr

    def guid_is_another(self):
        return self._script(REFUSED.replace("GUID", '"{0}"'))

    def value_is_refused(self):
        return self._script(REFUSED.replace("GUID", "description.guid"))

    step_is_discarded = value_is_refused

    def libcosim_ends(self):
        Row().of_package("libcosimpy", "libcosimpy", "", "libcosimpy.CosimExecution")
        return self._script(test_parameters.LIBCOSIM.replace("WIND", "-1.0"))

    def container_is_built(self):
        Row().of_package("fmucontainer", "fmu-manipulation-toolbox", "", "fmu_manipulation_toolbox")
        return self.request.getfixturevalue("flow_first")[0]

    arrays_are_not_exposed = container_is_built

    def container_is_thrown_off(self):
        Row().of_package("fmucontainer", "fmu-manipulation-toolbox", "", "fmu_manipulation_toolbox")
        return self.request.getfixturevalue("flow_first")[1]


CASES = [name for name in vars(Provoked) if not name.startswith("_")]  # in the order of the table


def test_the_table_has_a_row_for_every_trouble():
    assert len(ROW.findall(PAGE.read_text())) == len(CASES)


@pytest.mark.parametrize("case", range(len(CASES)), ids=CASES)
def test_a_trouble_is_told_as_the_page_says(case, request, shell, tmp_path):
    said = getattr(Provoked(request, shell, tmp_path), CASES[case])()
    assert ROW.findall(PAGE.read_text())[case] in said
