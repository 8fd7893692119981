"""Each capability flag of the FMUs, and what the FMI functions beside set, get and doStep answer."""

import ctypes
import zipfile

import pytest
from lxml import etree

from tests.fmus.importer import Importer

OK, DISCARD, ERROR = 0, 2, 3
LAST_SUCCESSFUL_TIME = 2  # fmi2StatusKind


@pytest.fixture
def toy(toy_path):
    with Importer(toy_path) as importer:
        yield importer


def call(importer, function, *arguments):
    """Status of a C function of an instance."""
    return getattr(importer.slave.dll, function)(ctypes.c_void_p(importer.slave.component), *arguments)


def step(importer, t, dt=1.0):
    return call(importer, "fmi2DoStep", ctypes.c_double(t), ctypes.c_double(dt), 1)


def last_time(importer):
    value = ctypes.c_double()
    assert call(importer, "fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, ctypes.byref(value)) == OK
    return value.value


def test_the_flags_are_these_and_each_has_its_test(scene_paths):
    tested = {
        "needsExecutionTool": "true",  # test_the_binary_holds_no_interpreter
        "canHandleVariableCommunicationStepSize": "true",  # test_any_step_sizes_lead_to_the_same_equilibrium
        "canInterpolateInputs": "false",  # test_there_are_no_derivatives_and_no_steps_to_cancel
        "canBeInstantiatedOnlyOncePerProcess": "false",  # test_processes.py
        "canNotUseMemoryManagementFunctions": "true",  # test_memory_is_never_asked_of_the_importer
        "canGetAndSetFMUstate": "true",  # test_state.py
        "canSerializeFMUstate": "true",  # test_state.py
    }
    for path in scene_paths:
        with zipfile.ZipFile(path) as archive:
            flags = dict(etree.fromstring(archive.read("modelDescription.xml")).find("CoSimulation").attrib)
        assert flags.pop("modelIdentifier") == path.stem
        assert flags == tested  # what is not among them is false or 0: asynchronous steps, output and other derivatives


def test_the_binary_holds_no_interpreter(scene_paths):
    for path in scene_paths:
        with zipfile.ZipFile(path) as archive:
            assert b"PyObject_CallMethod" in archive.read(f"binaries/linux64/{path.stem}.so")  # is looked for outside
            assert b"Python 3.11 or newer with numpy and scipy" in archive.read("documentation/index.html")


def test_any_step_sizes_lead_to_the_same_equilibrium(scene_paths):
    ends = []
    for sizes in ([1.0] * 6, [0.1, 3.0, 1e-3, 20.0, 0.5, 1e-9]):
        with Importer(scene_paths[0]) as structural, Importer(scene_paths[1]) as aero:
            t = 0.0
            for dt in sizes:
                assert step(aero, t, dt) == OK
                structural.set(pressure=aero.get("pressure"))
                assert step(structural, t, dt) == OK
                aero.set(displacement=structural.get("displacement"))
                t += dt
                assert last_time(aero) == last_time(structural) == t
            ends.append(structural.get("displacement"))
    assert ends[0] == ends[1]  # quasi-static: time is a counter of exchanges
    assert any(ends[0])


def test_memory_is_never_asked_of_the_importer(toy):
    assert not toy.callbacks.allocateMemory  # a null pointer: to call it would end this process
    state = toy.slave.getFMUstate()
    content = toy.slave.serializeFMUstate(state)
    for used in (state, toy.slave.deSerializeFMUstate(content)):
        toy.slave.setFMUstate(used)
        toy.slave.freeFMUstate(used)
    assert step(toy, 0.0) == OK


def test_there_are_no_derivatives_and_no_steps_to_cancel(toy):
    reference, order, value = (ctypes.c_uint * 1)(0), (ctypes.c_int * 1)(1), (ctypes.c_double * 1)()
    one = ctypes.c_size_t(1)
    assert call(toy, "fmi2SetRealInputDerivatives", reference, one, order, value) == ERROR
    assert call(toy, "fmi2GetRealOutputDerivatives", reference, one, order, value) == ERROR
    assert call(toy, "fmi2GetDirectionalDerivative", reference, one, reference, one, value, value) == ERROR
    assert call(toy, "fmi2CancelStep") == ERROR
    assert step(toy, 0.0) == OK


def test_a_string_is_refused_by_a_sentence_and_not_by_the_end_of_the_process(toy):
    reference, one = (ctypes.c_uint * 1)(0), ctypes.c_size_t(1)
    text = (ctypes.c_char_p * 1)(b"text")
    assert call(toy, "fmi2GetString", reference, one, text) == ERROR
    assert text[0] == b""
    assert call(toy, "fmi2SetString", reference, one, text) == ERROR
    assert toy.log == [(ERROR, "There are no String variables.")] * 2
    assert step(toy, 0.0) == OK


def test_the_last_successful_time_is_where_a_discarded_step_began(toy):
    trouble = toy.references["trouble"]
    assert step(toy, 0.0) == OK
    assert last_time(toy) == 1.0
    toy.slave.setInteger([trouble], [1])
    assert step(toy, 1.0) == DISCARD
    assert last_time(toy) == 1.0
    toy.slave.setInteger([trouble], [0])
    assert step(toy, 1.0, 0.5) == OK
    assert last_time(toy) == 1.5
    toy.slave.reset()
    assert last_time(toy) == 0.0
    toy.slave.setupExperiment(startTime=4.0)
    assert last_time(toy) == 4.0
    toy.slave.enterInitializationMode()
    toy.slave.exitInitializationMode()


@pytest.mark.parametrize("chosen", ["logStatusDiscard", "logStatusError", "logAll", None])
def test_a_log_category_that_is_offered_is_logged_when_chosen_and_else_not(toy, chosen):
    with zipfile.ZipFile(toy.path) as archive:
        categories = etree.fromstring(archive.read("modelDescription.xml")).find("LogCategories")
    assert [category.get("name") for category in categories] == ["logStatusError", "logStatusDiscard"]
    names = (ctypes.c_char_p * 1)((chosen or "").encode())
    assert (
        call(toy, "fmi2SetDebugLogging", int(chosen is not None), ctypes.c_size_t(len(chosen or "") > 0), names) == OK
    )
    place, one = (ctypes.c_uint * 1)(toy.references["position[1,1]"]), ctypes.c_size_t(1)
    assert call(toy, "fmi2SetReal", place, one, (ctypes.c_double * 1)(1.0)) == ERROR  # refused at once
    assert step(toy, 0.0) == DISCARD
    heard = {"logStatusDiscard": [DISCARD], "logStatusError": [ERROR], "logAll": [ERROR, DISCARD]}
    assert [status for status, _ in toy.log] == heard.get(chosen, [])


def test_a_state_holds_whether_start_values_may_still_be_set(toy_path):
    with Importer(toy_path, initialise=False) as toy:
        toy.set(scale=[1.0, 1.0, 1.0])
        in_initialization = toy.slave.getFMUstate()
        toy.slave.exitInitializationMode()
        running = toy.slave.getFMUstate()
        toy.refused(scale=[2.0, 2.0, 2.0])
        assert step(toy, 0.0) == DISCARD  # fixed by now
        toy.slave.setFMUstate(in_initialization)
        toy.set(scale=[3.0, 3.0, 3.0])
        assert toy.get("offset") == [3.0 * (0.1 + 0.2)] * 3
        toy.slave.setFMUstate(running)
        assert toy.get("offset") == [0.1 + 0.2] * 3
        assert step(toy, 0.0) == OK
        toy.refused(scale=[2.0, 2.0, 2.0])
        refused = toy.slave.getFMUstate()
        assert [step(toy, 1.0), step(toy, 1.0)] == [DISCARD, OK]
        toy.slave.setFMUstate(refused)
        assert [step(toy, 1.0), step(toy, 1.0)] == [DISCARD, OK]
        for state in (in_initialization, running, refused):
            toy.slave.freeFMUstate(state)


def test_start_values_that_a_parameter_brings_about_show_and_give_way_to_those_that_are_set(kite_aero):
    with Importer(kite_aero, initialise=False) as aero:
        at_rest = aero.get("displacement")
        aero.set(trim_angle=0.1)
        aero.get("CL")
        turned = aero.get("displacement")
        assert turned != at_rest
        raised = [x + 0.01 for x in turned]
        aero.set(displacement=raised, trim_angle=0.2)
        aero.slave.exitInitializationMode()
        assert aero.get("displacement") == raised
        assert step(aero, 0.0) == OK
        assert aero.get("displacement") == raised
