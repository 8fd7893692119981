"""The binary of the FMUs where it meets Python: what is raised, who waits, how scripts are read, and Python's end."""

import ctypes
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import fmpy
import numpy as np
import pytest
from pythonfmu.enums import Fmi2Status

from tests.fmus.test_capabilities import step

ERROR = 3  # fmi2Status


@pytest.fixture
def toy(own_toy):
    return own_toy


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
    return lambda name, method: monkeypatch.setattr(toy.script.ToyFmu, name, method)


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
    assert 1000 - len(character.encode()) <= len(text.encode()) < 1000  # the room in fmus/binary/slave.c


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


def made_by(toy, folder, stem, text="", threads=4):
    """Instances, None where there is none, of some threads at once, from a script in a folder of resources."""
    folder.mkdir()
    (folder / "slavemodule.txt").write_text(stem)
    (folder / f"{stem}.py").write_text(text)
    dll, guid, place = toy.slave.dll, toy.description.guid.encode(), str(folder).encode()

    def instance(_):
        return dll.fmi2Instantiate(b"x", 1, guid, place, ctypes.byref(toy.callbacks), 0, 0)

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(instance, range(threads)))


def test_a_script_that_fails_or_has_no_slave_says_so(toy, tmp_path):
    assert made_by(toy, tmp_path / "a", "failing", "raise OSError('not now')", threads=1) == [None]
    assert [text for _, text in toy.log] == ["OSError: not now"]
    assert made_by(toy, tmp_path / "b", "empty", "a = 1") == [None] * 4
    assert toy.log[-1][1] == "ValueError: empty.py has no class with a method do_step."


def test_a_script_is_whole_for_every_thread_that_makes_an_instance(toy, tmp_path):
    text = "class Slave:\n    def __init__(self, **_): self.log_queue = []\n    def do_step(self): pass\n"
    made = made_by(toy, tmp_path / "c", "slow", "import time\ntime.sleep(0.2)\n" + text)
    assert all(made)
    first = sys.modules["slow"]
    made += made_by(toy, tmp_path / "d", "slow", text, threads=1)  # the same name with another text
    assert sys.modules["slow"] is not first
    for one in made:
        toy.slave.dll.fmi2FreeInstance(ctypes.c_void_p(one))
    del sys.modules["slow"]


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
