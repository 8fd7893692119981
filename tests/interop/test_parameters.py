"""A parameter given in a tool as the page says reaches the FMU: the flow on the wing as it starts, in another wind."""

import sys

import numpy as np
import pytest

from tests.interop import reference
from tests.interop.tools import Row, container, program

WIND = 11.0  # m/s, where the FMUs were built for 12

LIBCOSIM = """
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
from kite_pair import FMUS, REFERENCES

execution = CosimExecution.from_step_size(1_000_000_000)
index = {"aero": execution.add_local_slave(CosimLocalSlave(FMUS["aero"], "aero"))}
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.real_initial_value(index["aero"], REFERENCES["aero"]["wind_speed"], WIND)
execution.step()
print("lift", *observer.last_real_values(index["aero"], [REFERENCES["aero"]["force[3]"]]))
"""

ECOS = """
from ecospy import EcosSimulation, EcosSimulationStructure
from kite_pair import FMUS

structure = EcosSimulationStructure()
structure.add_model("aero", FMUS["aero"])
structure.add_parameter_set("start", {"aero::wind_speed": WIND})
simulation = EcosSimulation(step_size=1.0, structure=structure)
simulation.init(parameter_set="start")
simulation.step()
print("wind", simulation.get_real("aero::wind_speed"))
print("lift", simulation.get_real("aero::force[3]"))
"""

FMPY = """
import fmpy
from kite_pair import FMUS

start = {"wind_speed": WIND}
rows = fmpy.simulate_fmu(FMUS["aero"], stop_time=1.0, step_size=1.0, start_values=start, output=["force[3]"])
print("lift", rows["force[3]"][-1])
"""


def printed(shell, script, wind=WIND):
    """What a script prints in the folder of the page's scripts."""
    done = program([sys.executable, "-c", script.replace("WIND", repr(wind))], shell.folder)
    return done.stdout + done.stderr


def lift(text):
    return float(next(line for line in text.splitlines() if line.startswith("lift")).split()[1])


@pytest.fixture(scope="module")
def expected():
    core = reference.scene().cores()["aero"]
    core.set("trim_angle", np.array(reference.scene().with_trim({"wind_speed": reference.WIND})["trim_angle"]))
    core.set("wind_speed", np.array(WIND))
    core.step(0.0, 1.0)
    return float(core.get("force")[2])


@pytest.mark.parametrize(
    ("package", "module", "script"),
    [
        ("fmpy", "fmpy", FMPY),
        ("libcosimpy", "libcosimpy.CosimExecution", LIBCOSIM),
        ("ecospy", "ecospy", ECOS),
    ],
    ids=["fmpy", "libcosimpy", "ecospy"],
)
def test_the_wind_that_is_given_before_the_first_step_blows(package, module, script, shell, expected):
    Row().of_package(package, package, "", module)
    assert lift(printed(shell, script)) == expected  # to the last bit, as the two solve the same problem


def test_ecos_says_nothing_of_a_value_that_is_refused_but_gives_the_old_one_back(shell):
    Row().of_package("ecospy", "ecospy", "")
    assert f"wind {reference.WIND}\n" in printed(shell, ECOS, -1.0)


@pytest.mark.parametrize("way", ["START", "-auto-parameter"])
def test_a_container_takes_the_wind_from_its_table_or_exposes_it(way, shell, expected, tmp_path):
    Row().of_package("fmucontainer", "fmu-manipulation-toolbox", "", "fmu_manipulation_toolbox")
    start_row = f"START;v3_kite_aero.fmu;wind_speed;{WIND};"
    options, rows = ((), [start_row]) if way == "START" else ((way,), [])
    path, _ = container(shell.folder, tmp_path.name, ("aero", "structural"), "-sequential", *options, rows=rows)
    start = {} if way == "START" else {"v3_kite_aero.wind_speed": WIND}
    script = f"""
import fmpy

rows = fmpy.simulate_fmu("{path}", stop_time=1.0, step_size=1.0, start_values={start}, output=["force[3]"])
print("lift", rows["force[3]"][-1])
"""
    assert lift(printed(shell, script)) == expected
