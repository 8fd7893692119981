"""The two FMUs of a scene as files: reproducible, complete, and with the start values that were asked for."""

import re
import shutil
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

import scenes
from fmus.builder import build
from fmus.stored_scene import read_scene


def entries(path):
    """Name -> content of every file in an FMU."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def parameter(scene, side):
    """A real scalar parameter of a side whose start value may be raised by half: its name, and the core."""
    core = getattr(scene, f"{side}_core")()
    found = [v for v in core.variables if v.causality == "parameter" and v.kind == "real" and not v.shape]
    return next(v.name for v in found if v.maximum is None or v.maximum > 10.0 * abs(v.start) + 1.0), core


def test_two_builds_give_the_same_bytes(scene, scene_paths, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    again = build(scenes.load(scene.name, scene.settings), "some/where/else")
    assert [path.name for path in again] == [f"{scene.name}_structural.fmu", f"{scene.name}_aero.fmu"]
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in scene_paths]


def test_another_content_has_another_guid(scene, scene_paths, tmp_path):
    name, _ = parameter(scene, "structural")
    other = build(scene, tmp_path, {name: 3.25})
    guids = {fmpy.read_model_description(str(path)).guid for path in (*scene_paths, other[0])}
    assert len(guids) == 3


def test_a_build_prints_nothing_and_leaves_nothing_but_the_fmus(scene, tmp_path, capfd):
    paths = build(scene, tmp_path)
    build(scene, tmp_path)  # over what is there
    assert capfd.readouterr() == ("", "")
    assert sorted(tmp_path.iterdir()) == sorted(paths)


def test_model_identifiers_are_c_identifiers_and_name_the_binaries(scene_paths):
    identifiers = [fmpy.read_model_description(str(path)).coSimulation.modelIdentifier for path in scene_paths]
    assert len(set(identifiers)) == 2
    for path, identifier in zip(scene_paths, identifiers, strict=True):
        assert re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII)
        assert f"binaries/linux64/{identifier}.so" in entries(path)
        assert f"binaries/win64/{identifier}.dll" in entries(path)


def test_a_scene_in_a_folder_with_an_awkward_name_builds_and_loads(scene, tmp_path):
    folder = tmp_path / "3 rue de l'île"
    shutil.copytree(scene.folder, folder)
    paths = build(scenes.load(folder, scene.settings), tmp_path / "out")
    for path in paths:
        identifier = fmpy.read_model_description(str(path)).coSimulation.modelIdentifier
        assert re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII)
        assert fmpy.simulate_fmu(path, stop_time=1.0, output_interval=1.0)["time"].tolist() == [0.0, 1.0]


def test_fmus_carry_data_and_the_code_of_their_side_under_one_private_name(scene, scene_paths):
    roots = set()
    for path, side, other in zip(scene_paths, ("structural", "aero"), ("aero/vortex_step", "structural"), strict=True):
        resources = [name.removeprefix("resources/") for name in entries(path) if name.startswith("resources/")]
        tops = {name.partition("/")[0] for name in resources}
        (root,) = {top for top in tops if re.fullmatch(r"kitecosim_\w{8}", top)}
        assert tops == {root, "scene.json", "scene.npz", "slavemodule.txt", f"{side}_fmu_{root[-8:]}.py"}
        inside = [name.removeprefix(f"{root}/") for name in resources if name.startswith(f"{root}/")]
        assert f"scenes/cores/{'core' if side == 'structural' else 'flow'}.py" in inside
        assert all(name.endswith(".py") for name in inside)
        left_out = "scenes/readers/", "scenes/builders/", "fmus/builder.py", "pythonfmu/tests/", f"{other}/"
        assert not [name for name in inside if name.startswith(left_out)]
        roots.add(root)
    assert len(roots) == 1


@pytest.mark.parametrize("side", ["structural", "aero"])
def test_overridden_parameters_are_start_values_in_the_description_and_in_an_instance(scene, tmp_path, side):
    name, _ = parameter(scene, side)
    value = 0.1 + 0.2  # needs 17 digits
    path = build(scene, tmp_path, {name: value})[side == "aero"]
    described = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    assert float(described[name].start) == value
    assert fmpy.simulate_fmu(path, stop_time=0.0, output=[name])[name].tolist() == [value]


@pytest.mark.parametrize("value", [float("nan"), "fast", [1.0, 2.0]])
def test_a_bad_start_value_is_refused_before_anything_is_written(scene, tmp_path, value):
    name, _ = parameter(scene, "aero")
    with pytest.raises(ValueError, match=name):
        build(scene, tmp_path / "out", {name: value})
    assert not (tmp_path / "out").exists()


def test_an_unknown_parameter_is_refused_with_the_names_that_exist(scene, tmp_path):
    name, _ = parameter(scene, "aero")
    with pytest.raises(ValueError, match=f"no parameter 'moon_phase'.*{name}"):
        build(scene, tmp_path / "out", {"moon_phase": 0.5})
    assert not (tmp_path / "out").exists()


def test_the_description_starts_where_the_cores_start(scene, scene_paths):
    for path, core in zip(scene_paths, (scene.structural_core(), scene.aero_core()), strict=True):
        described = fmpy.read_model_description(str(path)).modelVariables
        start = [v.start for v in described if v.causality != "output"]
        numbers = [
            {"true": 1.0, "false": 0.0}.get(text) if text in ("true", "false") else float(text) for text in start
        ]
        values = [np.ravel(core.get(v.name)) for v in core.variables if v.causality != "output"]
        assert numbers == np.concatenate(values).tolist()


def test_settings_travel_with_the_fmu(scene, scene_paths, tmp_path):
    for path, side in zip(scene_paths, ("structural", "aero"), strict=True):
        carried, _ = read_scene(Path(fmpy.extract(str(path), str(tmp_path / side))) / "resources")
        assert (carried.settings, carried.choices) == (scene.settings, scene.choices)
        assert (carried.structure, carried.aero) == (scene.structure, scene.aero)
        assert carried.interface.nodes.tobytes() == scene.interface.nodes.tobytes()
