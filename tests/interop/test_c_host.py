"""A host in plain C couples the pair: same values, states that come back, refusals, threads, and a clean exit."""

import fcntl
import os
from pathlib import Path

import fmpy
import numpy as np
import pytest

from tests.interop import reference
from tests.interop.c_host import ENVIRONMENTS, SOURCES, compiled, compiler, environment, lacking, steps, wiring
from tests.interop.tools import Row, program

TUNED = 12.5  # m/s, set before the last two steps

# Environment, binary in the FMUs, order, how the host opens them.
RUNS = [
    *((name, "own", "serial", "now") for name in ENVIRONMENTS),
    ("host-env", "own", "serial", "lazy"),
    ("host-env", "own", "parallel", "now"),
    ("host-env --preload", "PythonFMU", "serial", "now"),
    ("host-env --preload", "PythonFMU", "parallel", "lazy"),
]


@pytest.fixture(scope="module", params=RUNS, ids=lambda run: ", ".join(run))
def ended(request, wired, tmp_path_factory):
    """The parameters of a run of the host till the pair is at rest, and how it ended, or why there is none."""
    place, binary, order, mode = request.param
    if reason := lacking(binary):
        return request.param, reason
    folder = tmp_path_factory.mktemp("run")
    command = [str(request.getfixturevalue("host")), str(wired[binary]), order, mode, str(reference.STEPS)]
    return request.param, program(command, folder, environment(place))


def test_a_c_host_gets_the_values_of_its_order_and_comes_to_rest(ended, row):
    (place, binary, order, mode), done = ended
    row.tool = f"C host, {binary} binary, {mode}, {place}"
    row.order = f"{order}, two threads" if order == "parallel" else order
    if isinstance(done, str):
        row.not_run(done)
    row.version = compiler()
    first, *again = steps(done.stdout)
    assert first.shape == (reference.STEPS, len(reference.names())), done.stderr
    row.difference = reference.difference(first, order)
    assert row.difference <= reference.SAME
    assert reference.distance(first) <= reference.AT_REST
    for values in again:  # from a state that went through bytes, half-way
        assert np.array_equal(values, first[reference.STEPS // 2 :])
    assert len(again) == (order == "serial")


def test_a_c_host_ends_by_itself_with_exit_code_0(ended):
    _, done = ended
    if isinstance(done, str):
        Row.not_run(done)
    assert done.stdout.splitlines()[-1] == "done", done.stderr
    assert done.returncode == 0
    assert done.stderr == ""


def test_both_fmus_may_be_the_first_in_the_process_in_two_threads_at_once(shell, tmp_path):
    if reason := lacking():
        Row.not_run(reason)
    host = compiled(tmp_path, sources=[SOURCES[0].parent / "at_once.c"])
    arguments = []
    for side in ("aero", "structural"):
        folder = fmpy.extract(str(shell.folder / f"my_fmus/v3_kite_{side}.fmu"), str(tmp_path / side))
        place = Path(folder)
        arguments += [
            str(place / f"binaries/linux64/v3_kite_{side}.so"),
            fmpy.read_model_description(folder).guid,
            (place / "resources").as_uri(),
        ]
    here = tmp_path / "where the host was started"
    here.mkdir()
    for name in ("sysconfig.py", "numpy.py"):
        (here / name).write_text("raise SystemExit('of no concern')\n")
    with host.open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # as another process may: no concern either
        for _ in range(5):  # they meet anew each time
            done = program([str(host), *arguments], here, environment("host-env"))
            assert (done.stdout, done.stderr, done.returncode) == ("done\n", "", 0)


def test_a_c_host_tunes_a_parameter_and_goes_on_after_a_refusal(host, shell, tmp_path):
    if reason := lacking():
        Row.not_run(reason)
    paths = {side: shell.folder / f"my_fmus/v3_kite_{side}.fmu" for side in ("structural", "aero")}
    file = wiring(tmp_path, paths, tuned=TUNED, refused=-1.0)
    done = program([str(host), str(file)], tmp_path, environment("host-env"))
    assert done.returncode == 0, done.stderr
    first, again = steps(done.stdout)
    assert len(first) == 10
    assert reference.difference(first, "serial", tune=(8, TUNED)) <= reference.SAME
    assert np.array_equal(again, first[5:])  # the wind of the state, and tuned again
    lines = done.stdout.splitlines()
    ends = {name: lines.index(f"{name} {status}") for name, status in (("refused", 3), ("discarded", 2))}
    for line in ends.values():  # fmi2Error, then fmi2Discard, each with its reason before it
        assert "wind_speed must be between 0.001 and 340 m/s, not -1; it stays 12.5 m/s." in lines[line - 1]
    assert "recovered 0" in lines


def test_a_home_of_another_python_is_named_as_what_stops_this_one(host, wired, tmp_path):
    if reason := lacking():
        Row.not_run(reason)
    place = environment("host-env") | {"PYTHONHOME": str(tmp_path)}
    done = program([str(host), str(wired["own"])], tmp_path, place)
    assert f"{place['KITECOSIM_PYTHON']} cannot be run with PYTHONHOME={tmp_path};" in done.stdout
    assert done.returncode == 2


@pytest.mark.parametrize("script", ["sleep 1000", "exec >/dev/null; sleep 1000", "(sleep 1000)& echo x; sleep 1000"])
def test_a_python_that_hangs_is_given_up_with_a_sentence(script, host, wired, tmp_path):
    hangs = tmp_path / "hangs"
    hangs.write_text(f"#!/bin/sh\n{script}\n")
    hangs.chmod(0o755)
    place = {"PATH": os.environ["PATH"], "KITECOSIM_PYTHON": str(hangs), "KITECOSIM_PYTHON_SECONDS": "0.5"}
    done = program([str(host), str(wired["own"])], tmp_path, place)
    assert f"{hangs} gives no answer within 0.5 s (KITECOSIM_PYTHON_SECONDS);" in done.stdout
    assert done.returncode == 2


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_nothing_reads_or_writes_where_it_must_not(order, wired, tmp_path):
    library = program(["gcc", "-print-file-name=libasan.so"], tmp_path).stdout.strip() if not lacking() else ""
    if reason := lacking() or ("gcc has no sanitizers" if library == "libasan.so" else ""):
        Row.not_run(reason)
    checked = compiled(tmp_path, "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    # Python keeps what it has allocated till the end of the process, which is no leak of the host.
    place = environment("host-env") | {"ASAN_OPTIONS": "detect_leaks=0"}
    done = program([str(checked), str(wired["own"]), order], tmp_path, place)
    assert (done.returncode, done.stderr) == (0, "")
