"""The FMU of a rigid wing: an aerodynamic model by itself. Exact equality with the core in this process throughout."""

import csv
import io
import subprocess
import sys
import zipfile
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest

import scenes
from fmus.builder import build, own_binary
from fmus.documentation.picture import VIEWS, _outline
from fmus.documentation.reference import STEPS
from fmus.ssp import package
from tests.fmus.cases import COARSE, RIGID
from tests.fmus.importer import Importer
from tests.fmus.test_fmi3 import Arrays
from tests.scenes.rigid import rigid_v3


@pytest.fixture(scope="module", params=["rigid_v3", *(name for name, _ in RIGID)])
def scene(request, tmp_path_factory):
    """A wing of strips, and every built-in scene without a structure."""
    if request.param == "rigid_v3":
        return scenes.load(rigid_v3(tmp_path_factory.mktemp("rigid")))
    return scenes.load(request.param, COARSE[request.param])


@pytest.fixture(scope="module")
def paths(scene, tmp_path_factory):
    return build(scene, tmp_path_factory.mktemp("fmus"))


def turned(scene, k):
    """A shape of the wing: turned nose-up and bent, so that neither motion nor symmetry are special."""
    nodes = scene.interface.nodes
    span = np.ptp(nodes[:, 1])
    bent = 0.01 * k * span * ((nodes[:, 1] / span) ** 2 + 0.2 * nodes[:, 1] / span)
    return scene.heading.started(nodes, {"trim_angle": 0.02 * k}) - nodes + np.outer(bent, [0.0, 0.0, 1.0])


def wind(k):
    return [1.0, 0.02 * k, 0.05 + 0.01 * k]


def values(side, scene):
    return {v.name: np.ravel(side.get(v.name)).tolist() for v in scene.aero_core().variables}


def test_it_is_the_only_one_and_answers_as_the_core_in_this_process(scene, paths):
    (path,) = paths
    assert path.name == f"{scene.name}_aero.fmu"
    core = scene.aero_core()
    with Importer(path) as fmu:
        core.look()
        assert values(fmu, scene) == values(core, scene)
        for k in range(4):
            for side in (core.set, lambda name, value: fmu.set(**{name: np.ravel(value).tolist()})):
                side("displacement", turned(scene, k))
                side("wind_direction", wind(k))
            core.step(float(k), 1.0)
            fmu.slave.doStep(float(k), 1.0)
            assert values(fmu, scene) == values(core, scene)


def test_steps_after_a_restored_state_repeat_also_in_a_new_instance(scene, paths):
    def stepped(fmu, k):
        fmu.set(displacement=np.ravel(turned(scene, k)).tolist(), wind_direction=wind(k))
        fmu.slave.doStep(float(k), 1.0)
        return values(fmu, scene)

    with Importer(paths[0]) as fmu, Importer(paths[0]) as other:
        stepped(fmu, 1)
        state = fmu.slave.getFMUstate()
        content = fmu.slave.serializeFMUstate(state)
        at_save, first = values(fmu, scene), [stepped(fmu, k) for k in (2, 3)]
        fmu.set(wind_speed=25.0)
        stepped(fmu, 6)
        fmu.slave.setFMUstate(state)
        assert values(fmu, scene) == at_save
        assert [stepped(fmu, k) for k in (2, 3)] == first
        fmu.slave.freeFMUstate(state)
        state = other.slave.deSerializeFMUstate(content)
        other.slave.setFMUstate(state)
        assert values(other, scene) == at_save
        assert [stepped(other, k) for k in (2, 3)] == first
        other.slave.freeFMUstate(state)


@pytest.mark.skipif(own_binary() is None, reason="not run: no C compiler was there when the project was installed")
def test_with_whole_arrays_it_is_the_same(scene, paths, tmp_path):
    (path,) = build(scene, tmp_path, fmi=3)
    with Arrays(path) as arrays, Importer(paths[0]) as fmu:
        for k in range(3):
            arrays.set("displacement", turned(scene, k))
            fmu.set(displacement=np.ravel(turned(scene, k)).tolist())
            arrays.slave.doStep(float(k), 1.0)
            fmu.slave.doStep(float(k), 1.0)
            for name in arrays.variables.keys() - {"time"}:
                assert np.ravel(arrays.get(name)).tolist() == fmu.get(name), name


def test_its_reference_results_are_of_a_wing_that_turns_nose_up(scene, paths):
    with zipfile.ZipFile(paths[0]) as archive:
        tables = [archive.read(f"documentation/{scene.name}_aero_{kind}.csv").decode() for kind in ("in", "ref")]
    inputs, results = ([*csv.DictReader(io.StringIO(table))] for table in tables)
    assert (len(inputs), len(results)) == (STEPS, STEPS + 1)
    lift = [float(row["CL"]) for row in results]
    assert lift[0] == lift[1]
    assert np.all(np.diff(lift[1:]) > 0.0)


def test_it_runs_where_nothing_of_this_project_is(paths, tmp_path):
    folder = fmpy.extract(str(paths[0]), tmp_path / "fmu")
    script = "import fmpy, sys; r = fmpy.simulate_fmu(sys.argv[1], stop_time=2.0, output=['CL']); print(r['CL'][-1])"
    done = subprocess.run(
        [sys.executable, "-c", script, folder], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert 0.0 < float(done.stdout) < 0.6


def test_it_carries_neither_structural_code_nor_a_structure(paths):
    with zipfile.ZipFile(paths[0]) as archive:
        names = archive.namelist()
        page = archive.read("documentation/index.html").decode()
    assert not [name for name in names if "/structural/" in name]
    assert "Without a structure" in page
    assert "structural one" not in page


def test_its_system_is_one_component(scene, paths, tmp_path):
    path = package(scene.name, paths, tmp_path)
    with zipfile.ZipFile(path) as archive:
        assert sorted(archive.namelist()) == ["SystemStructure.ssd", "resources/aero.fmu", "resources/aero.ssv"]
        root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
        assert archive.read("resources/aero.fmu") == paths[0].read_bytes()
    space = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
    (component,) = root.iter(f"{space}Component")
    assert component.get("name") == "aero"
    assert not list(root.iter(f"{space}Connection"))


def test_the_drawing_of_a_closed_body_is_its_outline(scene):
    """From behind and from the side nothing of the body lies outside of what is drawn, and little is drawn."""
    if scene.body is None:
        pytest.skip("a sheet, whose panels are drawn")
    nodes = scene.interface.nodes
    for _, *axes in VIEWS:
        ends = _outline(scene, np.array(axes)).reshape(-1, 3) @ np.array(axes).T
        flat = nodes @ np.array(axes).T
        size = np.ptp(flat, axis=0).max()
        np.testing.assert_allclose(ends.max(axis=0), flat.max(axis=0), rtol=0, atol=1e-9 * size)
        np.testing.assert_allclose(ends.min(axis=0), flat.min(axis=0), rtol=0, atol=1e-9 * size)
        assert len(ends) < len(nodes)
