"""A host in plain C couples the pair: same values, states that come back, refusals, threads, and a clean exit."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest

import fmus.builder
from tests.interop import reference
from tests.interop.conftest import ROOT, Row, program

SOURCES = [Path(__file__).parent / "host" / name for name in ("host.c", "wiring.c")]
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1", "-g"]
TUNED = 12.5  # m/s, set before the last two steps

# What is in the environment of a host beside the search path of programs; how it finds Python.
ENVIRONMENTS = ("python3 in PATH", "host-env", "host-env --preload")


def environment(name):
    """A whole environment: nothing comes from the one of the tests."""
    found = {"PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    if not name.startswith("host-env"):
        return found | {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin"}
    done = program([sys.executable, "-m", "master", *name.split()], ROOT)
    assert done.returncode == 0, done.stderr
    words = (shlex.split(line) for line in done.stdout.splitlines())
    return found | dict(word.split("=", 1) for export, word in words)


def compiled(folder, *flags):
    """The program, and the version of the compiler; a test without one is not run."""
    if (gcc := shutil.which("gcc")) is None:
        Row.not_run("there is no gcc")
    target = folder / "host"
    command = [gcc, *FLAGS, *flags, *map(str, SOURCES), "-o", str(target), "-ldl", "-lpthread"]
    done = program(command, folder)
    assert done.returncode == 0, done.stderr
    return target, program([gcc, "-dumpfullversion"], folder).stdout.strip()


@pytest.fixture(scope="session")
def host(tmp_path_factory):
    """The compiled host, and the version of its compiler."""
    return compiled(tmp_path_factory.mktemp("host"))


def wiring(folder, paths, tuned=None, refused=None, guid=None):
    """A file that tells the host all it has to know of the pair in `paths`, side -> FMU."""
    lines, references, inputs = [], {}, {}
    for side, path in paths.items():
        unzipped = Path(fmpy.extract(str(path), str(folder / f"unzipped {side}")))  # a space in every path
        description = fmpy.read_model_description(str(unzipped))
        references[side] = {v.name: v.valueReference for v in description.modelVariables}
        inputs[side] = [v.name for v in description.modelVariables if v.causality == "input"]
        lines += [
            f"binary {side} {unzipped}/binaries/linux64/{description.coSimulation.modelIdentifier}.so",
            f"resources {side} {(unzipped / 'resources').as_uri()}",
            f"guid {side} {guid or description.guid}",
        ]
    for source, target in (("aero", "structural"), ("structural", "aero")):
        lines += [
            f"connect {source} {references[source][name]} {target} {references[target][name]}"
            for name in inputs[target]
        ]
    lines += [f"watch {side} {references[side][name]}" for side, name in reference.names()]
    for kind, value in (("tune", tuned), ("refuse", refused)):
        if value is not None:
            lines.append(f"{kind} aero {references['aero']['wind_speed']} {value}")
    file = folder / "wiring.txt"
    file.write_text("\n".join(lines) + "\n")
    return file


@pytest.fixture(scope="session")
def wired(shell, tmp_path_factory):
    """The wiring of the pair, and of the same pair with PythonFMU's binary, by name."""
    folder = tmp_path_factory.mktemp("python fmu")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fmus.builder, "own_binary", lambda: None)
        built = fmus.builder.build(reference.scene(), folder, {"wind_speed": reference.WIND})
    plain = dict(zip(("structural", "aero"), built, strict=True))
    own = {side: shell.folder / f"my_fmus/v3_kite_{side}.fmu" for side in plain}
    return {"own": wiring(tmp_path_factory.mktemp("own"), own), "PythonFMU": wiring(folder, plain)}


def steps(printed):
    """The values that a host printed, (steps, names); those before and those after it was restored."""
    parts = []
    for part in printed.split("restored\n"):
        rows = (line.split()[2:] for line in part.splitlines() if line.startswith("step "))
        parts.append(np.array([[float.fromhex(word) for word in row] for row in rows]))
    return parts


# Environment, binary in the FMUs, order, how the host opens them.
RUNS = [
    *((name, "own", "serial", "now") for name in ENVIRONMENTS),
    ("host-env", "own", "serial", "lazy"),
    ("host-env", "own", "parallel", "now"),
    ("host-env --preload", "PythonFMU", "serial", "now"),
    ("host-env --preload", "PythonFMU", "parallel", "lazy"),
]


@pytest.fixture(scope="module", params=RUNS, ids=lambda run: ", ".join(run))
def ended(request, host, wired):
    """A run of the host for so long that the pair comes to rest: its parameters, and how it ended."""
    place, binary, order, mode = request.param
    if binary == "own" and fmus.builder.own_binary() is None:
        Row.not_run("the FMUs have no binary of this project")
    command = [str(host[0]), str(wired[binary]), order, mode, str(reference.STEPS)]
    return request.param, program(command, host[0].parent, environment(place))


def test_a_c_host_gets_the_values_of_its_order_and_comes_to_rest(ended, host, row):
    (place, binary, order, mode), done = ended
    row.tool, row.version = f"C host, {binary} binary, {mode}, {place}", f"gcc {host[1]}"
    row.order = f"{order}, two threads" if order == "parallel" else order
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
    assert done.stdout.splitlines()[-1] == "done", done.stderr
    assert done.returncode == 0
    assert done.stderr == ""


def test_a_c_host_tunes_a_parameter_and_goes_on_after_a_refusal(host, shell, tmp_path):
    paths = {side: shell.folder / f"my_fmus/v3_kite_{side}.fmu" for side in ("structural", "aero")}
    file = wiring(tmp_path, paths, tuned=TUNED, refused=-1.0)
    done = program([str(host[0]), str(file)], tmp_path, environment("host-env"))
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


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_nothing_reads_or_writes_where_it_must_not(order, wired, tmp_path):
    if fmus.builder.own_binary() is None:
        Row.not_run("the FMUs have no binary of this project")
    checked, _ = compiled(tmp_path, "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    # Python keeps what it has allocated till the end of the process, which is no leak of the host.
    place = environment("host-env") | {"ASAN_OPTIONS": "detect_leaks=0"}
    done = program([str(checked), str(wired["own"]), order], tmp_path, place)
    assert (done.returncode, done.stderr) == (0, "")


def test_python_is_not_found_in_one_sentence(host, wired, tmp_path):
    bare = tmp_path / "bare"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(bare)], check=True, timeout=60)
    nothing = {"PATH": str(tmp_path)}
    for place, reason in (
        (nothing, "python3 cannot be run; python cannot be run"),
        ({"PATH": str(bare / "bin")}, "python3 has no numpy and no scipy"),
        (nothing | {"KITECOSIM_PYTHON": "/nowhere"}, "/nowhere cannot be run"),
    ):
        done = program([str(host[0]), str(wired["own"])], tmp_path, place)
        assert done.returncode == 2
        assert f"No Python was found for the FMU: {reason}" in done.stdout
        assert "an FMU cannot be instantiated" in done.stderr


def test_pythonfmu_s_binary_cannot_be_opened_without_python_s_library(host, wired, tmp_path):
    done = program([str(host[0]), str(wired["PythonFMU"])], tmp_path, environment("host-env"))
    assert done.returncode == 2
    assert "undefined symbol: _Py" in done.stderr


def test_a_foreign_guid_is_refused(host, shell, tmp_path):
    paths = {side: shell.folder / f"my_fmus/v3_kite_{side}.fmu" for side in ("structural", "aero")}
    done = program(
        [str(host[0]), str(wiring(tmp_path, paths, guid="{0}"))], tmp_path, environment("host-env")
    )
    assert done.returncode == 2
    assert "The GUID is not that of the FMU's model description." in done.stdout
