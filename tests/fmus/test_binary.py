"""The binary of the FMUs: what it does with what no host should pass, its instances and their states."""

import ctypes
import gc
import shutil

import fmpy
import pytest
from fmpy.fmi1 import FMICallException

from tests.fmus.importer import Importer
from tests.fmus.test_capabilities import call, step
from tests.fmus.toy_fmu import SAVED

OK, DISCARD, ERROR = 0, 2, 3
TERMINATED = 3  # fmi2StatusKind


@pytest.fixture
def toy(own_toy):
    return own_toy


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        ("fmi2GetReal", (None, ctypes.c_size_t(3), None)),
        ("fmi2SetReal", ((ctypes.c_uint * 1)(0), ctypes.c_size_t(1), None)),
        ("fmi2GetFMUstate", (None,)),
        ("fmi2SetFMUstate", (None,)),
        ("fmi2SetFMUstate", (ctypes.c_void_p(8),)),
        ("fmi2FreeFMUstate", (ctypes.byref(ctypes.c_void_p(8)),)),
        ("fmi2SerializedFMUstateSize", (ctypes.c_void_p(8), None)),
        ("fmi2DeSerializeFMUstate", (None, ctypes.c_size_t(5), None)),
        ("fmi2SetDebugLogging", (1, ctypes.c_size_t(2), None)),
        ("fmi2GetRealStatus", (2, None)),
        ("fmi2GetBooleanStatus", (3, None)),
        ("fmi2EnterInitializationMode", ()),
        ("fmi2ExitInitializationMode", ()),
        ("fmi2SetupExperiment", (0, ctypes.c_double(0), ctypes.c_double(0), 0, ctypes.c_double(0))),
    ],
)
def test_a_call_that_no_host_should_make_is_an_error_with_a_sentence_and_changes_nothing(toy, function, arguments):
    assert call(toy, function, *arguments) == ERROR
    assert [status for status, _ in toy.log] == [ERROR]
    assert toy.log[0][1].endswith(".")
    assert step(toy, 0.0) in (OK, DISCARD)  # discarded where the slave has refused the call itself
    assert step(toy, 0.0) == OK


@pytest.mark.parametrize("kind", ["", "Real", "Integer", "Boolean", "String"])
def test_a_status_that_cannot_be_told_is_discarded_with_a_sentence(toy, kind):
    place = getattr(toy.slave.dll, f"fmi2Get{kind}Status").argtypes[2]._type_()
    assert call(toy, f"fmi2Get{kind}Status", 1, ctypes.byref(place)) == DISCARD
    ((status, sentence),) = toy.log
    assert status == DISCARD
    assert sentence.endswith(".")
    assert step(toy, 0.0) == OK


def test_the_host_need_not_keep_its_callbacks(toy):
    callbacks = type(toy.callbacks).from_buffer_copy(toy.callbacks)
    make, free = toy.slave.dll.fmi2Instantiate, toy.slave.dll.fmi2FreeInstance
    made = ctypes.c_void_p(make(b"x", 1, toy.description.guid.encode(), None, ctypes.byref(callbacks), 0, 0))
    ctypes.memset(ctypes.byref(callbacks), 0, ctypes.sizeof(callbacks))
    assert toy.slave.dll.fmi2CancelStep(made) == ERROR
    assert toy.log[-1] == (ERROR, "fmi2CancelStep is not supported.")
    free(made)


def test_every_function_takes_a_null_pointer_for_an_instance(toy):
    for name in dir(toy.slave):
        if name.startswith("fmi2") and name not in ("fmi2Instantiate", "fmi2GetVersion", "fmi2GetTypesPlatform"):
            function = getattr(toy.slave.dll, name)
            status = function(None, *[kind() for kind in function.argtypes[1:]])
            assert name == "fmi2FreeInstance" or status == ERROR, name


def test_no_state_and_nothing_at_all_may_be_freed(toy):
    assert call(toy, "fmi2FreeFMUstate", None) == OK
    nothing = ctypes.c_void_p()
    assert call(toy, "fmi2FreeFMUstate", ctypes.byref(nothing)) == OK


def test_a_state_is_freed_once_and_no_state_outlives_its_instance(toy_path):
    gc.collect()
    before = len(SAVED)
    with Importer(toy_path) as toy:
        saved = toy.script.SAVED
        state = toy.slave.getFMUstate()
        copy = ctypes.c_void_p(state.value)
        toy.slave.freeFMUstate(state)
        for _ in range(2):
            assert call(toy, "fmi2FreeFMUstate", ctypes.byref(ctypes.c_void_p(copy.value))) == ERROR
            assert call(toy, "fmi2SetFMUstate", copy) == ERROR
        for _ in range(10):
            toy.slave.getFMUstate()  # and forgotten by the host
        assert len(saved) == before * (saved is SAVED) + 10
    gc.collect()
    assert len(saved) == before * (saved is SAVED)


def test_a_state_given_to_be_replaced_is_freed(toy):
    saved = toy.script.SAVED
    state = ctypes.c_void_p()
    for _ in range(5):
        assert call(toy, "fmi2GetFMUstate", ctypes.byref(state)) == OK
        gc.collect()
        assert len(saved) == 1
    toy.slave.freeFMUstate(state)


def test_a_state_is_not_written_past_the_end_of_the_memory_that_is_given(toy):
    state = toy.slave.getFMUstate()
    size = len(toy.slave.serializeFMUstate(state))
    memory = (ctypes.c_char * (size + 8))(*[b"x"] * (size + 8))
    assert call(toy, "fmi2SerializeFMUstate", state, memory, ctypes.c_size_t(size - 1)) == ERROR
    assert memory.raw == b"x" * (size + 8)
    assert toy.log[-1] == (ERROR, f"The state takes {size} bytes, and {size - 1} were given.")
    assert call(toy, "fmi2SerializeFMUstate", state, memory, ctypes.c_size_t(size + 8)) == OK
    assert memory.raw[size:] == b"x" * 8
    toy.slave.freeFMUstate(state)


def test_the_fmu_asks_to_terminate_after_a_discarded_step_and_no_longer_after_a_good_one(toy):
    def terminated():
        value = ctypes.c_int(-1)
        assert call(toy, "fmi2GetBooleanStatus", TERMINATED, ctypes.byref(value)) == OK
        return value.value

    assert step(toy, 0.0) == OK
    assert not terminated()
    toy.slave.setInteger([toy.references["trouble"]], [1])
    assert step(toy, 1.0) == DISCARD
    assert terminated()
    toy.slave.setInteger([toy.references["trouble"]], [0])
    assert step(toy, 1.0) == OK
    assert not terminated()


@pytest.mark.parametrize(
    ("name", "kind", "guid", "sentence"),
    [
        ("", 1, None, "An instance needs a name that is not empty."),
        ("x", 0, None, "The FMU is for co-simulation only."),
        ("x", 1, "{of another}", "The GUID is not that of the FMU's model description."),
        ("x", 1, "", "The GUID is not that of the FMU's model description."),
    ],
)
def test_an_instance_that_cannot_be_is_refused_with_a_sentence(toy, name, kind, guid, sentence):
    guid = toy.description.guid if guid is None else guid
    place = toy.slave.dll.fmi2Instantiate
    made = place(name.encode(), kind, guid.encode(), b"", ctypes.byref(toy.callbacks), 0, 0)
    assert not made
    assert toy.log[-1] == (ERROR, sentence)


@pytest.mark.parametrize("folder", ["plain", "with a space", "50 % of l'île", "a%20b"])
def test_resources_are_found_wherever_they_lie(toy_path, tmp_path, folder):
    place = tmp_path / folder
    fmpy.extract(toy_path, place)
    description = fmpy.read_model_description(place)
    for uri in ((place / "resources").as_uri(), f"file://localhost{(place / 'resources').as_uri()[7:]}", None):
        slave = fmpy.fmi2.FMU2Slave(
            guid=description.guid, modelIdentifier="toy", unzipDirectory=str(place), instanceName="x"
        )
        callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        slave.component = slave.dll.fmi2Instantiate(
            b"x", 1, description.guid.encode(), uri and uri.encode(), ctypes.byref(callbacks), 0, 0
        )
        assert slave.component
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slave.doStep(0.0, 1.0)
        slave.freeInstance()
    shutil.rmtree(place)


@pytest.mark.parametrize(
    ("name", "version", "form"),
    [
        ("a%20b", 3, "{}"),  # a path, which FMI 3.0 has
        ("a%20b", 3, "{}/"),
        ("a%20b", 2, "{}"),
        ("ends with %a", 2, "file://{}"),  # URIs that are not escaped as they should be
        ("50 % a day", 2, "file://{}"),
        ("% 1", 2, "file:{}"),
    ],
)
def test_a_per_cent_sign_that_escapes_nothing_is_one(toy, tmp_path, name, version, form):
    place = tmp_path / name
    shutil.copytree(f"{toy.folder}/resources", place)
    (place / "slavemodule.txt").write_text("no such")  # only the folder that is meant has it
    made = instantiated(toy, version, form.format(place).encode())
    assert not made
    assert toy.log[-1][1] == "ModuleNotFoundError: No module named 'no such'"


def instantiated(toy, version, resources):
    """Another instance from the same binary, or None."""
    dll, guid = toy.slave.dll, toy.description.guid.encode()
    if version == 2:
        return dll.fmi2Instantiate(b"x", 1, guid, resources, ctypes.byref(toy.callbacks), 0, 0)
    make = dll.fmi3InstantiateCoSimulation
    make.restype = ctypes.c_void_p
    log = fmpy.fmi3.fmi3LogMessageCallback(lambda _, status, category, text: toy.log.append((status, text.decode())))
    return make(b"x", guid, resources, False, False, False, False, None, ctypes.c_size_t(0), None, log, None)


def test_a_reset_instance_takes_fixed_parameters_again_and_forgets_what_was_set(toy):
    before = toy.get("load"), toy.get("offset")
    toy.set(load=3.0)
    assert step(toy, 0.0) == OK
    toy.slave.reset()
    assert (toy.get("load"), toy.get("offset")) == before
    toy.set(scale=2.0)
    assert step(toy, 0.0) == DISCARD  # not before it is initialised
    toy.slave.setupExperiment()
    toy.slave.enterInitializationMode()
    toy.slave.exitInitializationMode()
    assert toy.get("scale") == [2.0] * 3
    assert step(toy, 0.0) == OK


def test_after_its_end_an_instance_takes_and_does_nothing_more_until_it_is_reset(toy):
    toy.slave.terminate()
    before = toy.get("load")
    assert "terminated" in toy.refused(load=1.0)
    assert toy.get("load") == before
    assert step(toy, 0.0) == DISCARD
    with pytest.raises(FMICallException):
        toy.slave.terminate()
    toy.slave.reset()
    toy.slave.setupExperiment()
    toy.slave.enterInitializationMode()
    toy.slave.exitInitializationMode()
    assert step(toy, 0.0) == OK
