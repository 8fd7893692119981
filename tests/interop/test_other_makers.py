"""FMUs of other makers in `kitecosim couple`, as their packages ship or make them: they do what their own tests say."""

import importlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from pythonfmu import FmuBuilder

from master import couple
from master.fmu_coupling import Document
from master.fmu_coupling.mapping import Described, MappedParticipant
from tests.interop.tools import program
from tests.master.test_couple import START, oscillator
from tests.master.toy_fmus import FLUID, WALL, python_fmu

STATES = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}


def models(package):
    """The folder with the test models of a package; the test is skipped where it brings none."""
    try:
        folder = Path(importlib.import_module(package).__file__).parent / "tests/slaves"
    except ImportError:
        pytest.skip(f"not run: {package} is not installed; pip install {package} brings its test models")
    if not folder.is_dir():
        pytest.skip(f"not run: this {package} was installed without its test models")
    return folder


@pytest.fixture(scope="module")
def pythonfmu(tmp_path_factory):
    """The folder with the test models of PythonFMU as FMUs."""
    source, folder = models("pythonfmu"), tmp_path_factory.mktemp("pythonfmu")
    before = list(sys.path)
    FmuBuilder.build_FMU(source / "pythonslave.py", dest=folder, **STATES)
    FmuBuilder.build_FMU(source / "slavewithdep.py", dest=folder, project_files=[source / "localmodule.py"])
    FmuBuilder.build_FMU(source / "PythonSlaveWithException.py", dest=folder)
    text = source.parent / "data/hello.txt"
    FmuBuilder.build_FMU(source / "pythonslave_read_file.py", dest=folder, project_files=[text])
    sys.path[:] = before
    return folder


def chain(**changes):
    """The time at the end of its step from one test model of PythonFMU to another."""
    content = {
        "time": {"stop": 1.0, "step": 0.1},
        "coupling": {"scheme": "explicit"},
        "participants": {
            "first": {"fmu": "PythonSlave.fmu", "start": {"stringParameter": "cat", "container.someReal": 7.0}},
            "second": {"fmu": "PythonSlaveWithDep.fmu"},
        },
        "connections": [{"from": "first.realOut", "to": "second.realIn"}],
        "results": {"record": ["second.realOut", "first.realOut", "first.intOut", "first.container.someReal"]},
    }
    return content | changes


def test_the_models_of_pythonfmu_do_in_a_chain_what_their_sources_say(pythonfmu):
    rows = []
    result = couple(Document.of(chain(), pythonfmu), follow=lambda *told: rows.append(told))
    assert result.status == "converged", result.message
    assert result.values["first.intOut"] == 23
    assert result.values["first.container.someReal"] == 7.0
    for _, _, _, values in rows[1:]:
        end = float(values["first.realOut"])
        assert float(values["second.realOut"]) == end * 5.0 * math.exp(end / 0.1)


def test_a_model_of_pythonfmu_returns_to_a_state_also_in_another_instance(pythonfmu):
    path = pythonfmu / "PythonSlave.fmu"
    with MappedParticipant(path) as fmu, MappedParticipant(path) as other:
        assert fmu.get("realOut") == 3.0
        fmu.step(0.0, 0.1)
        state = fmu.save()
        fmu.step(0.1, 0.1)
        assert fmu.get("realOut") == 0.2
        fmu.restore(state)
        assert fmu.get("realOut") == 0.1
        copy = other.deserialised(fmu.serialised(state))
        other.restore(copy)
        assert other.get("realOut") == 0.1
        other.free(copy)
        fmu.free(state)


def test_a_model_of_pythonfmu_that_raises_ends_the_run_with_a_sentence(pythonfmu):
    content = chain()
    content["participants"]["second"] = {"fmu": "PythonSlaveWithException.fmu"}
    content["results"] = {"record": ["first.realOut"]}
    result = couple(Document.of(content, pythonfmu))
    assert result.status == "diverged"
    assert "participant second" in result.message
    assert "RuntimeError" in result.message


def test_a_model_of_pythonfmu_finds_its_file_and_its_text_is_refused_as_a_number(pythonfmu):
    described = Described(pythonfmu / "PythonSlaveReadFile.fmu")
    assert "as a text, and only numbers can be exchanged" in described.unknown("file_content")
    with MappedParticipant(pythonfmu / "PythonSlaveReadFile.fmu") as fmu:
        fmu.step(0.0, 1.0)


def test_the_models_of_pythonfmu3_give_their_arrays_and_times(tmp_path):
    source = models("pythonfmu3")
    from pythonfmu3 import FmuBuilder as Builder

    script = tmp_path / "slave_of_fmi3.py"  # modules of two FMUs in a process need two names
    script.write_text((source / "pythonslave.py").read_text())
    before = list(sys.path)
    Builder.build_FMU(script, dest=tmp_path)
    Builder.build_FMU(source / "pythonslave_arraytypes.py", dest=tmp_path)
    sys.path[:] = before
    content = {
        "time": {"stop": 0.5, "step": 0.1},
        "coupling": {"scheme": "explicit"},
        "participants": {
            "arrays": {"fmu": "ArrayTypes.fmu", "blocks": {"third": "float64_output[3]"}},
            "slave": {"fmu": "PythonSlave.fmu", "start": {"intParam": 5, "stringParameter": "cat"}},
        },
        "connections": [{"from": "arrays.third", "to": "slave.realIn", "factor": 2.0}],
        "results": {
            "record": ["slave.realOut", "slave.intParam", "slave.realIn"]
            + [f"arrays.{kind}_output" for kind in ("float64", "int32", "int64", "uint64", "boolean")]
        },
    }
    result = couple(Document.of(content, tmp_path))
    assert result.status == "converged", result.message
    values = result.values
    assert values["slave.realOut"] == pytest.approx(0.5, rel=1e-15)
    assert (values["slave.intParam"], values["slave.realIn"]) == (5.0, 6.0)
    for kind in ("float64", "int32", "int64", "uint64"):
        assert values[f"arrays.{kind}_output"].tolist() == list(range(1, 11))
    assert values["arrays.boolean_output"].tolist() == [0, 1, 0, 1, 1, 0, 0, 1, 0, 1]


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """The folder with wall.fmu and fluid.fmu."""
    folder = tmp_path_factory.mktemp("pair")
    python_fmu("wall", WALL, folder, **STATES)
    python_fmu("fluid", FLUID, folder)
    return folder


def explicit(pair, **participants):
    result = couple(Document.of(oscillator(scheme="explicit", **participants), pair))
    assert result.status == "converged", result.message
    return result.values


@pytest.mark.parametrize("version", [2, 3])
def test_a_container_of_the_manipulation_toolbox_is_the_fmu_in_it_to_the_last_bit(pair, version):
    pytest.importorskip("fmu_manipulation_toolbox", reason="not run: fmu_manipulation_toolbox is not installed")
    name = f"box{version}"
    (pair / f"{name}.csv").write_text("rule;from_fmu;from_port;to_fmu;to_port\nFMU;wall.fmu;;;\n")
    build = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer; fmucontainer()"
    options = ["-container", f"{name}.csv:0.1", "-fmi", str(version), "-auto-parameter"]
    done = program([sys.executable, "-c", build, "-fmu-directory", ".", *options], pair)
    assert done.returncode == 0, done.stdout + done.stderr
    given = {"mass": 1.0, "stiffness": 1.0, "q0_1": START[0], "q0_2": START[1]}
    inside = {f"wall.{key}": float(value) for key, value in given.items()} | {"load": [-3.0, -1.5]}
    found, expected = explicit(pair, wall={"fmu": f"{name}.fmu", "start": inside}), explicit(pair)
    assert all(np.array_equal(found[key], expected[key]) for key in expected)


def test_a_container_of_fmpy_is_the_fmu_in_it_to_the_last_bit(pair):
    from fmpy.model_description import CoSimulation, ModelDescription, ModelVariable

    container = pytest.importorskip("fmpy.container_fmu.config", reason="not run: this fmpy makes no containers")
    from fmpy.container_fmu.cli import create_container_fmu

    inner = read_model_description(str(pair / "fluid.fmu"), validate=False)
    component = container.Component("fluid", pair / "fluid.fmu", inner)
    mapped = {}
    for variable in inner.modelVariables:
        if variable.type == "Real" and variable.name != "offset":
            own = {key: getattr(variable, key) for key in ("name", "causality", "variability")}
            first = None if variable.start is None else str(float(variable.start))
            outer = ModelVariable(valueReference=0, type="Float64", start=first, **own)
            mapped[outer] = [(component, variable)]
    description = ModelDescription()
    description.fmiVersion, description.modelName = "3.0", "container"
    description.guid = description.instantiationToken = "{container}"
    description.coSimulation = CoSimulation(modelIdentifier="container", fixedInternalStepSize=0.1)
    time = ModelVariable("time", 0, type="Float64", causality="independent", variability="continuous")
    description.modelVariables = [time, *mapped]  # the container counts its variables behind the time
    folder = pair / "container"
    folder.mkdir()
    create_container_fmu(
        container.Configuration(False, description, [component], [], mapped), folder, pair / "container.fmu"
    )
    found, expected = explicit(pair, fluid={"fmu": "container.fmu"}), explicit(pair)
    assert all(np.array_equal(found[key], expected[key]) for key in expected)
