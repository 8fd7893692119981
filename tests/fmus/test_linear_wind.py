"""FMUs of scenes whose wind is linear in space: their parameters, and the answers of the core in this process."""

import numpy as np
import pytest

import scenes
from fmus.builder import build, own_binary
from tests.fmus.importer import Importer
from tests.fmus.test_fmi3 import Arrays
from tests.scenes.broken import copy_of
from tests.scenes.rigid import flat_wing

TABLES = """
[aero.linear_wind]
ground = [-30.0, 2.0, -100.0]
kite = [0.0, 0.0, 300.0]
ground_share = 0.2

[aero.rotation]
rate = [0.01, 0.02, -0.03]
"""
UNITS = {
    "ground_point[1]": "m", "kite_point[3]": "m", "ground_wind_share": "1", "turn_rate[2]": "rad/s",
    "turn_centre[1]": "m", "wind_at_origin[1]": "m/s", "wind_gradient[1,3]": "1/s",
}  # fmt: skip
BODY = """title = "closed wing"

[body]
shape = "wing"
profile = "0012"
panels = 16
span = 6.0
chord = 1.0
strips = 4

[aero]
method = "panel"
wind_speed = 10.0
wind_direction = [1.0, 0.0, 0.1]
reference_area = 6.0
symmetric = true
"""


@pytest.fixture(scope="module", params=["strips", "panels", "lines in motion"])
def scene(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    if request.param == "strips":
        return scenes.load(flat_wing(folder, twist=0.1, aero=TABLES))
    if request.param == "panels":
        (folder / "closed_wing").mkdir()
        (folder / "closed_wing/scene.toml").write_text(BODY + TABLES)
        return scenes.load(folder / "closed_wing")
    path = copy_of("tether_in_wind", folder)
    file = path / "scene.toml"
    file.write_text(file.read_text() + TABLES)
    return scenes.load(path)


@pytest.fixture(scope="module")
def path(scene, tmp_path_factory):
    return build(scene, tmp_path_factory.mktemp("fmus"))[-1]


def test_it_answers_as_the_core_in_this_process(scene, path):
    core = scene.aero_core()
    rng = np.random.default_rng(0)
    shape = core.get("displacement").shape
    names = [v.name for v in core.variables]
    with Importer(path) as fmu:
        for k in range(3):
            given = {
                "displacement": 0.02 * k * np.sin(scene.interface.nodes[:, [1, 2, 0]]),
                "ground_point": [-30.0 + k, 2.0, -100.0],
                "ground_wind_share": 0.1 * k,
                "turn_rate": [0.01 * k, 0.02, -0.03],
            }
            if "velocity" in names:
                given["velocity"] = 0.1 * rng.standard_normal(shape)
            for name, value in given.items():
                core.set(name, value)
                fmu.set(**{name: np.ravel(value).tolist()})
            core.step(float(k), 1.0)
            fmu.slave.doStep(float(k), 1.0)
            for name in names:
                assert np.ravel(fmu.get(name)).tolist() == np.ravel(core.get(name)).tolist(), name


@pytest.mark.skipif(own_binary() is None, reason="not run: no C compiler was there when the project was installed")
def test_with_whole_arrays_it_is_the_same(scene, tmp_path):
    core = scene.aero_core()
    with Arrays(build(scene, tmp_path, fmi=3)[-1]) as arrays:
        for name, value in {"turn_rate": [0.02, 0.01, -0.03], "ground_point": [-31.0, 2.0, -100.0]}.items():
            core.set(name, value)
            arrays.set(name, value)
        core.step(0.0, 1.0)
        arrays.slave.doStep(0.0, 1.0)
        for name in arrays.variables.keys() - {"time"}:
            assert np.ravel(arrays.get(name)).tolist() == np.ravel(core.get(name)).tolist(), name


def test_what_says_where_the_wind_is_how_fast_has_units(path):
    with Importer(path) as fmu:
        found = {v.name: v.unit for v in fmu.description.modelVariables}
    assert {name: found[name] for name in UNITS} == UNITS
