"""The host in plain C: compiled, wired, in an environment of its own; and what it has printed."""

import shlex
import shutil
import sys
from pathlib import Path

import fmpy
import numpy as np

from fmus.builder import own_binary
from tests.interop import reference
from tests.interop.tools import ROOT, program

SOURCES = [Path(__file__).parent / "host" / name for name in ("host.c", "wiring.c")]
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1", "-g"]

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


def lacking(binary="own"):
    """Why the host cannot run FMUs with a binary, own or PythonFMU; empty if it can."""
    if shutil.which("gcc") is None:
        return "there is no gcc"
    return "the FMUs have no binary of this project" if binary == "own" and own_binary() is None else ""


def compiler():
    """Name and version of the compiler."""
    return f"gcc {program(['gcc', '-dumpfullversion'], ROOT).stdout.strip()}"


def compiled(folder, *flags, sources=SOURCES):
    """The program."""
    target = folder / "host"
    command = ["gcc", *FLAGS, *flags, *map(str, sources), "-o", str(target), "-ldl", "-lpthread"]
    done = program(command, folder)
    assert done.returncode == 0, done.stderr
    return target


def wiring(folder, paths, tuned=None, refused=None, guid=None, watched=None):
    """A file that tells the host all it has to know of the pair in `paths`, side -> FMU; what it prints are those of
    `reference.names` unless others are `watched`.
    """
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
    lines += [f"watch {side} {references[side][name]}" for side, name in watched or reference.names()]
    for kind, value in (("tune", tuned), ("refuse", refused)):
        if value is not None:
            lines.append(f"{kind} aero {references['aero']['wind_speed']} {value}")
    file = folder / "wiring.txt"
    file.write_text("\n".join(lines) + "\n")
    return file


def steps(printed):
    """The values that a host printed, (steps, names); those before and those after it was restored."""
    parts = []
    for part in printed.split("restored\n"):
        rows = (line.split()[2:] for line in part.splitlines() if line.startswith("step "))
        parts.append(np.array([[float.fromhex(word) for word in row] for row in rows]))
    return parts
