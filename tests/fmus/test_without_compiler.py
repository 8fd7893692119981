"""FMUs where the binary of this project was not compiled: they carry that of PythonFMU, and that is said."""

import subprocess
import sys

import pytest
from typer.testing import CliRunner

import scenes
from fmus import builder
from master.cli import app
from tests.fmus.importer import Importer
from tests.fmus.test_capabilities import step
from tests.fmus.toy_fmu import Toy, ToyFmu

OK = 0  # fmi2Status


@pytest.mark.parametrize("command", [["build", "typical_section"], ["host-env"]], ids=" ".join)
def test_an_installation_without_a_compiler_says_what_its_fmus_need(monkeypatch, tmp_path, command):
    monkeypatch.chdir(tmp_path)
    compiled, silent = CliRunner().invoke(app, command), builder.own_binary() is not None
    monkeypatch.setattr(builder, "own_binary", lambda: None)
    plain = CliRunner().invoke(app, command)
    assert compiled.exit_code == plain.exit_code == 0
    assert plain.stdout == compiled.stdout  # what a shell evaluates, what a script reads
    assert "host-env --preload" in plain.stderr
    assert (compiled.stderr == "") is silent
    assert CliRunner().invoke(app, ["host-env", "--preload"]).stderr == ""


def test_an_fmu_that_was_built_without_a_compiler_works_with_the_binary_of_pythonfmu(monkeypatch, toy_path, tmp_path):
    monkeypatch.setattr(builder, "own_binary", lambda: None)
    path = tmp_path / "toy.fmu"
    path.write_bytes(builder.archive("toy", ToyFmu(Toy(), instance_name="toy"), {}))
    ends = []
    for fmu in (path, toy_path):
        with Importer(fmu) as toy:
            for t in range(3):
                toy.set(load=0.5 + t)
                assert step(toy, float(t)) == OK
            state = toy.slave.getFMUstate()
            copy = toy.slave.deSerializeFMUstate(toy.slave.serializeFMUstate(state))
            toy.slave.setFMUstate(copy)
            for used in (state, copy):  # PythonFMU's binary frees none by itself
                toy.slave.freeFMUstate(used)
            toy.set(load=-1.0)
            assert step(toy, 3.0) == OK
            ends.append((toy.get("position"), toy.get("steps"), toy.get("loaded")))
    assert ends[0] == ends[1]


MANY = """
import sys
import fmpy
from fmpy.fmi2 import FMU2Slave

ends = []
for path in sys.argv[1:]:
    folder = fmpy.extract(path)
    description = fmpy.read_model_description(folder)
    made = [FMU2Slave(guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier,
                      unzipDirectory=folder, instanceName=f"x{k}") for k in range(5)]
    for slave in made:
        slave.instantiate()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slave.doStep(0.0, 1.0)
    ends.append({slave.getReal([v.valueReference for v in description.modelVariables if v.type == "Real"][-1:])[0]
                 for slave in made})
    for slave in made:
        slave.terminate()
        slave.freeInstance()
assert [len(found) for found in ends] == [1, 1], ends
"""


def test_many_instances_of_a_scene_live_with_the_binary_of_pythonfmu(monkeypatch, tmp_path):
    monkeypatch.setattr(builder, "own_binary", lambda: None)
    paths = builder.build(scenes.load("typical_section"), tmp_path, reference=False)
    for order in (paths, paths[::-1]):
        command = [sys.executable, "-I", "-c", MANY, *map(str, order)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
