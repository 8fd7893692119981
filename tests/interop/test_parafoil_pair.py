"""A flown parafoil, membranes and panels, as a pair of FMUs in hosts of others: the values of a plain loop."""

import json
import sys

import fmpy
import numpy as np
import pytest

import scenes
from fmus.builder import build
from fmus.description import scalar_names
from tests.interop.c_host import compiler, environment, lacking, steps, wiring
from tests.interop.tools import program

STEPS = 4
LOADS = "pressure", "shear", "line_load"
# The FMUs compute what the cores compute; the loop below passes on the same numbers.
SAME = 0.0
LIBCOSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

pair = json.load(open(sys.argv[1]))
execution = CosimExecution.from_step_size(1_000_000_000)
index = {side: execution.add_local_slave(CosimLocalSlave(path, side)) for side, path in pair["paths"].items()}
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
for source, one, target, other in pair["connections"]:
    assert execution.connect_real_variables(index[source], one, index[target], other) == 0
for _ in range(pair["steps"]):
    assert execution.step(), execution.status()
print("VALUES", json.dumps([observer.last_real_values(index[side], of) for side, of in pair["watched"].items()]))
"""


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    scene = scenes.load("parafoil_small")
    return scene, dict(zip(("structural", "aero"), build(scene, tmp_path_factory.mktemp("parafoil")), strict=True))


def watched(scene):
    """Every entry of the displacement, the shear and the pressure."""
    blocks = {(side, v.name): v for side, core in scene.cores().items() for v in core.variables}
    shown = (("structural", "displacement"), ("aero", "pressure"), ("aero", "shear"))
    return {(side, name): scalar_names(blocks[side, name]) for side, name in shown}


def trajectory(scene, order):
    """Values of `watched` after every step, (steps, names)."""
    cores = scene.cores()
    structural, aero = cores["structural"], cores["aero"]
    for name, value in scene.with_trim({}).items():
        for core in (structural, aero):
            if name in {v.name for v in core.variables}:
                core.set(name, np.array(value))

    def load():
        for name in LOADS:
            structural.set(name, aero.get(name))

    rows = []
    aero.set("displacement", structural.get("displacement"))
    aero.look()
    load()
    for k in range(STEPS):
        aero.step(float(k), 1.0)
        if order == "serial":
            load()
        structural.step(float(k), 1.0)
        rows.append(np.concatenate([np.ravel(cores[side].get(name)) for side, name in watched(scene)]))
        load()
        aero.set("displacement", structural.get("displacement"))
    return np.array(rows)


def test_a_c_host_flies_a_parafoil_as_the_cores_do_and_its_states_come_back(pair, host, row, tmp_path):
    row.tool, row.order = "C host, parafoil", "serial"
    if reason := lacking():
        row.not_run(reason)
    row.version = compiler()
    scene, paths = pair
    names = [(side, name) for (side, _), all_of in watched(scene).items() for name in all_of]
    command = [str(host), str(wiring(tmp_path, paths, watched=names)), "serial", "now", str(STEPS)]
    done = program(command, tmp_path, environment("host-env"))
    assert done.returncode == 0, done.stderr
    first, again = steps(done.stdout)
    row.difference = float(np.abs(first - trajectory(scene, "serial")).max())
    assert row.difference <= SAME
    assert np.array_equal(again, first[STEPS // 2 :])


def test_libcosim_flies_a_parafoil_as_the_cores_do(pair, row, tmp_path):
    row.of_package("libcosimpy, parafoil", "libcosimpy", "parallel", "libcosimpy.CosimExecution")
    scene, paths = pair
    described = {side: fmpy.read_model_description(str(path)).modelVariables for side, path in paths.items()}
    references = {side: {v.name: v.valueReference for v in found} for side, found in described.items()}
    connections = [
        (source, references[source][v.name], target, references[target][v.name])
        for source, target in (("aero", "structural"), ("structural", "aero"))
        for v in described[target]
        if v.causality == "input"
    ]
    of = {}
    for (side, _), names in watched(scene).items():
        of.setdefault(side, []).extend(references[side][name] for name in names)
    given = {"paths": {side: str(path) for side, path in paths.items()}, "steps": STEPS}
    file = tmp_path / "pair.json"
    file.write_text(json.dumps(given | {"connections": connections, "watched": of}))
    done = program([sys.executable, "-c", LIBCOSIM, str(file)], tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    printed = next(line for line in done.stdout.splitlines() if line.startswith("VALUES "))  # libcosim prints much else
    values = np.concatenate(json.loads(printed.removeprefix("VALUES ")))
    row.difference = float(np.abs(values - trajectory(scene, "parallel")[-1]).max())
    assert row.difference <= SAME
