"""The binary of the FMUs: what it does with what no host should pass, and an FMU without it."""

import ctypes
import gc
import shutil
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from pythonfmu.enums import Fmi2Status
from typer.testing import CliRunner

from fmus import builder
from fmus.instance import instance
from master.cli import app
from tests.fmus.importer import Importer
from tests.fmus.test_capabilities import call, step
from tests.fmus.toy_fmu import SAVED, Toy, ToyFmu

OK, DISCARD, ERROR = 0, 2, 3
TERMINATED = 3  # fmi2StatusKind


@pytest.fixture
def toy(toy_path):
    if builder.own_binary() is None:
        pytest.skip("not run: no C compiler was there when the project was installed")
    with Importer(toy_path) as importer:
        yield importer


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
        saved = sys.modules["toy_fmu"].SAVED
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
    saved = sys.modules["toy_fmu"].SAVED
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


def failing(*messages, error):
    """A method of a slave that logs, then raises."""

    def method(slave, *_):
        for message in messages:
            slave.log(message, Fmi2Status.warning)
        raise error

    return method


@pytest.fixture
def of_toy(toy, monkeypatch):
    """Replaces a method of the slave for the test."""
    return lambda name, method: monkeypatch.setattr(sys.modules["toy_fmu"].ToyFmu, name, method)


def test_what_was_logged_is_heard_before_the_exception_that_ended_the_call(toy, of_toy):
    of_toy("do_step", failing("first", "second", error=ZeroDivisionError("100 %")))
    assert step(toy, 0.0) == ERROR
    assert toy.log == [(1, "first"), (1, "second"), (ERROR, "ZeroDivisionError: 100 %")]


def test_a_message_with_what_utf_8_has_no_bytes_for_is_heard_all_the_same(toy, of_toy):
    of_toy("do_step", failing("a \udcff file", error=OSError("\udcff")))
    assert step(toy, 0.0) == ERROR
    assert toy.log == [(1, "a \\udcff file"), (ERROR, "OSError: an error without words")]


@pytest.mark.parametrize("begin", range(4))
@pytest.mark.parametrize("character", ["é", "€", "🪁"])
def test_a_long_error_is_cut_between_two_characters(toy, of_toy, begin, character):
    of_toy("do_step", failing(error=ValueError("x" * begin + 1000 * character)))
    assert step(toy, 0.0) == ERROR
    ((_, text),) = toy.log  # it has been decoded
    assert ("ValueError: " + "x" * begin + 1000 * character).startswith(text)
    assert 1000 - len(character.encode()) <= len(text.encode()) < 1000  # the room in fmus/front/slave.c


def test_a_result_without_a_truth_is_an_error(toy, of_toy):
    of_toy("do_step", lambda *_: np.zeros(2))
    assert step(toy, 0.0) == ERROR
    assert "ambiguous" in toy.log[-1][1]


def test_python_goes_on_while_the_host_takes_its_time_over_a_message(toy):
    """A host whose logger waits for another of its threads, which waits for Python, must not wait for ever."""
    log = fmpy.fmi2.fmi2CallbackLoggerTYPE(ctypes.cast(ctypes.CDLL(None).usleep, ctypes.c_void_p).value)
    callbacks = fmpy.fmi2.fmi2CallbackFunctions()
    callbacks.logger, callbacks.componentEnvironment = log, 500_000  # microseconds to sleep
    made = toy.slave.dll.fmi2Instantiate(b"x", 1, toy.description.guid.encode(), None, ctypes.byref(callbacks), 0, 0)
    ticks, over = [], threading.Event()
    thread = threading.Thread(target=lambda: [ticks.append(over.wait(0.01)) for _ in iter(over.is_set, True)])
    thread.start()
    assert toy.slave.dll.fmi2ExitInitializationMode(ctypes.c_void_p(made)) == ERROR  # refused by the slave
    over.set()
    thread.join()
    assert len(ticks) > 5  # of some 50; without Python there is none or one
    toy.slave.dll.fmi2FreeInstance(ctypes.c_void_p(made))


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
    assert str(place / "no such.py") in toy.log[-1][1].replace("%%", "%")


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


def test_a_script_is_whole_for_every_thread_that_makes_an_instance_and_is_read_anew_after_a_failure(tmp_path):
    (tmp_path / "slavemodule.txt").write_text("slow")
    script = tmp_path / "slow.py"
    script.write_text("import time\ntime.sleep(0.2)\nraise OSError('not now')\n")
    for _ in range(2):
        with pytest.raises(OSError, match="not now"):
            instance(str(tmp_path), "x", False)
    script.write_text("a = 1\n")
    with pytest.raises(ValueError, match=r"slow.py has no class with a method do_step\."):
        instance(str(tmp_path), "x", False)
    script.write_text(
        "import time\ntime.sleep(0.2)\nclass Slave:\n    def __init__(self, **_): pass\n    def do_step(self): pass\n"
    )
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda _: instance(str(tmp_path), "x", False), range(4)))
    assert {type(slave) for slave in made} == {sys.modules.pop("slow").Slave}


LATE = """
import atexit, ctypes, sys
import fmpy

path, guid, resources = sys.argv[1:]
dll = ctypes.CDLL(path)
dll.fmi2Instantiate.restype = ctypes.c_void_p
callbacks = fmpy.fmi2.fmi2CallbackFunctions()
made = ctypes.c_void_p(
    dll.fmi2Instantiate(b"x", 1, guid.encode(), resources.encode(), ctypes.byref(callbacks), 0, 0)
)
zero = ctypes.c_double(0.0)
assert dll.fmi2SetupExperiment(made, 0, zero, zero, 0, zero) == 0
assert dll.fmi2EnterInitializationMode(made) == dll.fmi2ExitInitializationMode(made) == 0
process = ctypes.CDLL(None)
at_end = getattr(process, "__cxa_atexit")
for function in (dll.fmi2FreeInstance, dll.fmi2Terminate, dll.fmi2Reset):  # the last is called first
    at_end(ctypes.cast(function, ctypes.c_void_p), made, None)
atexit.register(lambda: print(dll.fmi2DoStep(made, zero, ctypes.c_double(1.0), 0)))


class Late:
    def __del__(self, terminate=dll.fmi2Terminate, made=made, say=print):
        say(terminate(made))


sys.modules["late"] = Late()
"""


def test_a_host_may_call_while_python_ends_and_after_it_has_ended(toy):
    command = [sys.executable, "-c", LATE, toy.slave.dll._name, toy.description.guid, f"file://{toy.folder}/resources"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=toy.folder)
    assert (done.stdout, done.stderr, done.returncode) == ("0\n0\n", "", 0)
