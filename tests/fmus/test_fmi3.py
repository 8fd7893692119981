"""FMUs of FMI 3.0: the same solvers with whole arrays as variables. Exact equality with those of FMI 2.0 throughout."""

import ctypes
import shutil

import fmpy
import numpy as np
import pytest
from fmpy import fmi3
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from lxml import etree

from fmus import builder
from fmus.builder import build
from tests.fmus.cases import PLAIN, label, start
from tests.fmus.importer import Ending, Importer

DISCARD, ERROR = 2, 3
TYPES = {"Float64": ctypes.c_double, "Int32": ctypes.c_int32, "Boolean": ctypes.c_bool}

pytestmark = pytest.mark.skipif(
    builder.own_binary() is None, reason="not run: no C compiler was there when the project was installed"
)


class Arrays(Ending):
    """One instance of an FMU of FMI 3.0; `log` holds (status, message)."""

    def __init__(self, path, initialise=True):
        self.folder = fmpy.extract(str(path))
        description = fmpy.read_model_description(self.folder)
        self.variables = {v.name: v for v in description.modelVariables}
        self.log = []
        self.slave = fmi3.FMU3Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=self.folder,
            instanceName="x",
        )
        self.slave.instantiate(logMessage=lambda _, status, category, text: self.log.append((status, text.decode())))
        if initialise:
            self.slave.enterInitializationMode()
            self.slave.exitInitializationMode()

    def shape(self, name):
        return tuple(int(d.start) for d in self.variables[name].dimensions)

    def _call(self, verb, name, values):
        kind = self.variables[name].type
        memory = (TYPES[kind] * len(values))(*values)
        reference = (ctypes.c_uint32 * 1)(self.variables[name].valueReference)
        getattr(self.slave, f"fmi3{verb}{kind}")(self.slave.component, reference, 1, memory, len(values))
        return np.array(memory)

    def set(self, name, values):
        kind = {"Float64": float, "Int32": int, "Boolean": bool}[self.variables[name].type]
        self._call("Set", name, [kind(value) for value in np.ravel(values)])

    def get(self, name):
        size = int(np.prod(self.shape(name), dtype=int))
        return self._call("Get", name, [0] * size).reshape(self.shape(name))


@pytest.fixture(scope="module", params=PLAIN, ids=label)
def pair(request, tmp_path_factory):
    """A scene, and its FMUs of FMI 3.0 and of 2.0."""
    import scenes

    scene = scenes.load(*request.param)
    folder = tmp_path_factory.mktemp("fmi3")
    return scene, build(scene, folder, start(scene), fmi=3), build(scene, folder, start(scene), reference=False)


def test_the_validator_and_the_schema_find_no_problem(pair):
    schema = etree.XMLSchema(etree.parse(f"{fmpy.__path__[0]}/schema/fmi3/fmi3ModelDescription.xsd"))
    for path in pair[1]:
        assert path.name.endswith("_fmi3.fmu")
        assert validate_fmu(str(path)) == []
        folder = fmpy.extract(str(path))
        schema.assertValid(etree.parse(f"{folder}/modelDescription.xml"))
        shutil.rmtree(folder)


def test_every_block_is_one_variable_with_the_dimensions_of_the_core(pair):
    for core, path in zip(pair[0].cores().values(), pair[1], strict=True):
        described = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
        assert set(described) == {v.name for v in core.variables} | {"time"}
        for v in core.variables:
            assert tuple(int(d.start) for d in described[v.name].dimensions) == v.shape
            assert described[v.name].unit == (v.unit if v.kind == "real" else None)


def test_an_exchange_gives_what_fmus_of_fmi_2_give_beside_it_in_the_process_to_the_last_bit(pair):
    scene, three, two = pair
    dt = scene.communication_step
    if len(three) == 1:
        with Arrays(three[0]) as array, Importer(two[0]) as scalar:
            for t in range(3):
                array.set("pressure", np.full(array.shape("pressure"), t + 1.0))
                scalar.set(pressure=t + 1.0)
                array.slave.doStep(float(t), 1.0)
                scalar.slave.doStep(float(t), 1.0)
                assert np.ravel(array.get("displacement")).tolist() == scalar.get("displacement")
        return
    with Arrays(three[0]) as s3, Arrays(three[1]) as a3, Importer(two[0]) as s2, Importer(two[1]) as a2:
        loads = [name for name in ("pressure", "shear", "line_load") if name in a3.variables]
        for t in range(10):
            a3.slave.doStep(t * dt, dt)
            a2.slave.doStep(t * dt, dt)
            for name in loads:
                s3.set(name, a3.get(name))
                s2.set(**{name: a2.get(name)})
            s3.slave.doStep(t * dt, dt)
            s2.slave.doStep(t * dt, dt)
            for name in ("displacement", "velocity") if scene.transient else ("displacement",):
                a3.set(name, s3.get(name))
                a2.set(**{name: s2.get(name)})
            for array, scalar in ((s3, s2), (a3, a2)):
                for name in array.variables.keys() - {"time"}:
                    assert np.ravel(array.get(name)).tolist() == scalar.get(name), name
        assert float(a3.get("time")) == 9 * dt + dt


def test_a_state_repeats_the_steps_also_serialised_in_a_new_instance(pair):
    scene, path = pair[0], pair[1][0]
    dt = scene.communication_step
    with Arrays(path) as fmu, Arrays(path) as other:
        loads = {"pressure": np.ones(fmu.shape("pressure"))} if "pressure" in fmu.variables else {}
        if scene.has_flow:  # of the wing as it starts, so that there is an equilibrium
            flow = scene.aero_core()
            for name, value in start(scene).items():
                flow.set(name, value)
            loads = {name: flow.get(name) for name in ("pressure", "shear", "line_load") if name in fmu.variables}

        def steps(instance):
            found = []
            for t in range(3):
                for name, values in loads.items():
                    instance.set(name, (1.0 + 0.1 * t) * values)
                instance.slave.doStep(t * dt, dt)
                found.append(instance.get("displacement").tolist())
            return found

        steps(fmu)
        state = fmu.slave.getFMUState()
        content = fmu.slave.serializeFMUState(state)
        expected = steps(fmu)
        fmu.slave.setFMUState(state)
        assert steps(fmu) == expected
        fmu.slave.freeFMUState(state)
        copy = other.slave.deserializeFMUState(content)
        other.slave.setFMUState(copy)
        other.slave.freeFMUState(copy)
        assert steps(other) == expected


@pytest.mark.parametrize("folder", ["plain", "with a space", "50 % of l'île", "a%20b"])
def test_resources_are_found_wherever_they_lie(scene, tmp_path, folder):
    place = tmp_path / folder
    fmpy.extract(build(scene, tmp_path, fmi=3)[0], place)
    description = fmpy.read_model_description(place)
    slave = fmi3.FMU3Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(place),
        instanceName="x",
    )
    nothing = fmi3.fmi3LogMessageCallback(), fmi3.fmi3IntermediateUpdateCallback()
    for path in (f"{place}/resources/", f"{place}/resources", None):  # FMI 3.0 gives a path of the system, not a URI
        slave.component = slave.dll.fmi3InstantiateCoSimulation(
            b"x", description.guid.encode(), path and path.encode(), 0, 0, 0, 0, None, 0, None, *nothing
        )
        assert slave.component, path
        slave.fmi3FreeInstance(slave.component)


def test_what_does_not_fit_is_refused_and_the_old_values_stay(pair):
    with Arrays(pair[1][0]) as fmu:
        load, first, unit = ("pressure", "2", "Pa") if "pressure" in fmu.variables else ("line_load", "1,2", "N/m")
        before = fmu.get(load)
        bad = before.copy()
        bad.reshape(-1)[1] = np.nan
        with pytest.raises(FMICallException, match="error"):
            fmu.set(load, bad)
        assert fmu.log[-1] == (ERROR, f"{load}[{first}] must be finite, not nan; it stays 0 {unit}.")
        with pytest.raises(FMICallException, match="error"):
            fmu.set(load, before.reshape(-1)[:-1])
        assert fmu.log[-1] == (ERROR, f"There are {before.size - 1} values for {before.size} scalars.")
        with pytest.raises(FMICallException, match="error"):
            fmu.set("displacement", fmu.get("displacement"))
        assert "cannot be set: it is an output" in fmu.log[-1][1]
        np.testing.assert_array_equal(fmu.get(load), before)
        with pytest.raises(FMICallException, match="discard"):
            fmu.slave.doStep(0.0, 1.0)
        fmu.slave.doStep(0.0, 1.0)
        if "trim_angle" in fmu.variables:
            with pytest.raises(FMICallException, match="error"):
                fmu.set("trim_angle", [0.1])
            assert "fixed parameter" in fmu.log[-1][1]


@pytest.mark.parametrize(
    ("name", "token", "sentence"),
    [
        (b"", None, "An instance needs a name that is not empty."),
        (b"x", b"{of another}", "The instantiation token is not that of the FMU's model description."),
        (b"x", b"", "The instantiation token is not that of the FMU's model description."),
    ],
)
def test_an_instance_that_cannot_be_is_refused_with_a_sentence(pair, name, token, sentence):
    with Arrays(pair[1][0]) as fmu:
        token = fmu.slave.guid.encode() if token is None else token
        calls = fmu.slave.logMessage, fmi3.fmi3IntermediateUpdateCallback()
        made = fmu.slave.dll.fmi3InstantiateCoSimulation(name, token, b"", 0, 0, 0, 0, None, 0, None, *calls)
        assert not made
        assert fmu.log[-1] == (ERROR, sentence)


def test_types_that_no_variable_has_and_events_are_refused_with_a_sentence(pair):
    with Arrays(pair[1][0]) as fmu:
        with pytest.raises(FMICallException, match="error"):
            fmu.slave.fmi3GetFloat32(fmu.slave.component, (ctypes.c_uint32 * 1)(0), 1, (ctypes.c_float * 1)(), 1)
        assert fmu.log[-1] == (ERROR, "fmi3GetFloat32 is not supported.")
        with pytest.raises(FMICallException, match="error"):
            fmu.slave.fmi3EnterEventMode(fmu.slave.component)
        fmu.slave.doStep(0.0, 1.0)


def test_every_function_takes_null_pointers_for_the_instance_and_for_all_else(pair):
    with Arrays(pair[1][0]) as fmu:
        names = [n for n in dir(fmi3.FMU3Slave) if n.startswith("fmi3") and "Instantiate" not in n]
        for name in sorted(set(names) - {"fmi3GetVersion"}):
            function = getattr(fmu.slave.dll, name)
            rest = [kind() for kind in function.argtypes[1:]]
            assert function(None, *rest) == ERROR or name == "fmi3FreeInstance", name
            if name not in ("fmi3FreeInstance", "fmi3Terminate", "fmi3Reset", "fmi3SetDebugLogging"):
                count = len(fmu.log)
                status = function(ctypes.c_void_p(fmu.slave.component), *rest)
                assert status in (0, DISCARD, ERROR), name
                assert [s for s, _ in fmu.log[count:]] == ([status] if status else []), name
        one = (ctypes.c_uint32 * 1)(fmu.variables["symmetric"].valueReference)
        for name in ("Boolean", "Float64", "Int32"):
            for verb in ("Get", "Set"):
                function = getattr(fmu.slave.dll, f"fmi3{verb}{name}")
                assert function(ctypes.c_void_p(fmu.slave.component), one, 1, None, 1) == ERROR
        with pytest.raises(FMICallException, match="discard"):
            fmu.slave.doStep(0.0, 1.0)  # after calls that the slave has refused
        fmu.slave.doStep(0.0, 1.0)


def test_two_builds_give_the_same_bytes(pair, tmp_path):
    again = build(pair[0], tmp_path, start(pair[0]), fmi=3)
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in pair[1]]


def test_the_time_is_got_alone_and_among_other_variables(pair):
    with Arrays(pair[1][0]) as fmu:
        fmu.slave.doStep(0.0, 0.5)
        name = "displacement"
        values = np.ravel(fmu.get(name)).tolist()
        for names in (["time"], ["time", name], [name, "time"], ["time", name, "time", "time", name]):
            references = [fmu.variables[n].valueReference for n in names]
            expected = [value for n in names for value in ([0.5] if n == "time" else values)]
            assert fmu.slave.getFloat64(references, nValues=len(expected)) == expected
        with pytest.raises(FMICallException, match="error"):
            fmu.slave.getFloat64(references, nValues=len(expected) - 1)
        assert fmu.log[-1][1] == f"There is room for {len(expected) - 1} values, and {len(expected)} were asked for."


def test_before_the_first_step_the_last_successful_time_is_the_start(pair):
    with Arrays(pair[1][0], initialise=False) as fmu:
        fmu.slave.enterInitializationMode(startTime=7.0)
        fmu.slave.exitInitializationMode()
        last, flags = ctypes.c_double(), [ctypes.c_bool() for _ in range(3)]
        step, nan = fmu.slave.fmi3DoStep, float("nan")
        with pytest.raises(FMICallException, match="discard"):
            step(fmu.slave.component, 7.0, nan, True, *map(ctypes.byref, flags), ctypes.byref(last))
        assert last.value == 7.0


def test_fmpy_simulates_it(pair):
    path = pair[1][-1]
    winged = pair[0].has_wing
    name = "CL" if winged else "line_force" if pair[0].has_flow else "support_force"
    rows = fmpy.simulate_fmu(str(path), stop_time=3.0, output_interval=1.0, output=[name])
    assert rows["time"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert np.all(np.isfinite(rows[name]))


def test_without_the_projects_binary_there_is_none(monkeypatch, tmp_path, scene):
    monkeypatch.setattr(builder, "own_binary", lambda: None)
    with pytest.raises(ValueError, match="install a C compiler"):
        build(scene, tmp_path / "out", fmi=3)
    assert not (tmp_path / "out").exists()


def test_there_is_no_other_version(scene, tmp_path):
    with pytest.raises(ValueError, match="FMI 2 or 3, not 1"):
        build(scene, tmp_path / "out", fmi=1)
