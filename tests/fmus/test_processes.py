"""FMUs of both kinds sharing a process, and processes that know nothing of this project."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fmus
import scenes
from tests.fmus.cases import PLAIN, gust, label, start
from tests.fmus.importer import START, Importer

EXCHANGES = 3

# Explicit exchange with fmpy alone; `-I` hides this folder and PYTHONPATH from the interpreter.
SCRIPT = (
    START
    + """

def end(slave, folder):
    slave.terminate()
    slave.freeInstance()
    shutil.rmtree(folder)

paths = sys.argv[3:]
structural, s, structural_folder = start(paths[0])
taken = {"scenes", "structural", "aero", "fmus", "interface", "pythonfmu"}.intersection(sys.modules)
assert not taken, f"the packages of the FMU have a name of their own, not {taken}"
if sys.argv[1] == "alone":  # the folder that the packages came from goes before the aerodynamic FMU is made
    end(structural, structural_folder)
    structural, s, structural_folder = start(paths[0])
if paths[1:]:
    aero, a, aero_folder = start(paths[1])
    shared = [name for name in a if name in s and name in ("pressure", "shear", "line_load")]
    back = [name for name in ("displacement", "velocity") if name in a]
for k in range(int(sys.argv[2])):
    if paths[1:]:
        aero.doStep(float(k), 1.0)
        for name in shared:
            structural.setReal(s[name], aero.getReal(a[name]))
    else:
        pressure = 5.0 + 1e6 * abs(structural.getReal(s["displacement"])[2]) % 10.0  # as `gust` of the tests
        structural.setReal(s["pressure"], [pressure] * len(s["pressure"]))
    structural.doStep(float(k), 1.0)
    if paths[1:]:
        for name in back:
            aero.setReal(a[name], structural.getReal(s[name]))
last = structural.getReal(s["displacement"])
end(structural, structural_folder)
if paths[1:]:
    aero.doStep(9.0, 1.0)
    last += aero.getReal(a["pressure" if "pressure" in a else "line_load"])
    end(aero, aero_folder)
print([value.hex() for value in last])
"""
)


def exchanged(scene):
    """The same exchange by the solver cores of this process: displacements, then the pressures that follow."""
    structural, *flow = scene.cores().values()
    for core in (structural, *flow):
        for name, value in start(scene).items():
            core.set(name, value)
    if not flow:
        for k in range(EXCHANGES):
            pressure = gust(np.ravel(structural.get("displacement")).tolist())
            structural.set("pressure", np.full(structural.get("pressure").shape, pressure))
            structural.step(float(k), 1.0)
        return np.ravel(structural.get("displacement")).tolist()
    aero = flow[0]
    loads = [v.name for v in aero.variables if v.name in ("pressure", "shear", "line_load")]
    for k in range(EXCHANGES):
        aero.step(float(k), 1.0)
        for name in loads:
            structural.set(name, aero.get(name))
        structural.step(float(k), 1.0)
        for name in ("displacement", "velocity") if scene.transient else ("displacement",):
            aero.set(name, structural.get(name))
    displacement = np.ravel(structural.get("displacement")).tolist()
    aero.step(9.0, 1.0)
    return displacement + np.ravel(aero.get("pressure" if "pressure" in aero.names else "line_load")).tolist()


@pytest.mark.parametrize("case", PLAIN, indirect=True, ids=label)
@pytest.mark.parametrize("order", ["together", "alone"])
def test_a_process_that_knows_only_fmpy_gets_the_same_numbers_to_the_last_bit(case, tmp_path, order):
    scene, paths = case
    done = subprocess.run(
        [sys.executable, "-I", "-W", "error", "-c", SCRIPT, order, str(EXCHANGES), *map(str, paths)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert [float.fromhex(text.strip(" '")) for text in done.stdout.splitlines()[-1][1:-1].split(",")] == exchanged(
        scene
    )


def test_an_fmu_in_this_process_uses_the_packages_that_are_loaded_and_leaves_the_path_alone(scene_paths):
    before = list(sys.path), scenes.__file__, fmus.__file__
    with Importer(scene_paths[0]) as structural, Importer(scene_paths[1]) as aero:
        for slave in (structural.slave, aero.slave):
            slave.doStep(0.0, 1.0)
        assert (list(sys.path), sys.modules["scenes"].__file__, sys.modules["fmus"].__file__) == before


def test_two_instances_of_each_kind_do_not_see_each_other(scene_paths):
    with (
        Importer(scene_paths[0]) as loaded,
        Importer(scene_paths[1]) as aero,
        Importer(scene_paths[0]) as unloaded,
        Importer(scene_paths[1]) as other,
    ):
        initial = other.get("pressure")  # the loads on the wing as it starts
        raised = [1e-3 * i for i in range(len(aero.get("displacement")))]
        aero.set(displacement=raised)
        aero.slave.doStep(0.0, 1.0)
        pressure = aero.get("pressure")
        assert pressure != initial
        assert other.get("pressure") == initial
        loaded.set(pressure=pressure)
        for structural in (loaded, unloaded):
            structural.slave.doStep(0.0, 1.0)
        other.set(displacement=raised)
        other.slave.doStep(0.0, 1.0)
        assert other.get("pressure") == pressure  # the same problem gives the same bits
        assert loaded.get("displacement") != unloaded.get("displacement")
        assert unloaded.get("pressure") == [0.0] * len(pressure)


LATE = """
import sys
from pathlib import Path
from master.coupling import FmuParticipant
{first}
with FmuParticipant(sys.argv[1]) as structural:
    structural.step(0.0, 1.0)
import scenes
from fmus.builder import build
scene = scenes.load(sys.argv[3])
assert build(scene, sys.argv[2])[0].read_bytes() == Path(sys.argv[1]).read_bytes()
scene.aero_core().step(0.0, 1.0)
"""


@pytest.mark.parametrize("first", ["", "import scenes"])
def test_the_project_works_on_in_a_process_where_an_fmu_brought_its_packages_first(scene, scene_paths, tmp_path, first):
    done = subprocess.run(
        [
            sys.executable,
            "-W",
            "error",
            "-c",
            LATE.format(first=first),
            str(scene_paths[0]),
            str(tmp_path),
            str(scene.folder),
        ],
        cwd=Path(fmus.__file__).parents[1],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
