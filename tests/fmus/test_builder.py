"""The two FMUs of a scene as files: reproducible, complete, and with the start values that were asked for."""

import json
import re
import shutil
import zipfile

import fmpy
import numpy as np
import pytest

import scenes
from fmus.builder import build


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


def test_both_fmus_carry_the_same_packages_and_the_scene_and_nothing_else(scene, scene_paths):
    structural, aero = map(entries, scene_paths)
    different = {name for name in structural.keys() | aero.keys() if structural.get(name) != aero.get(name)}
    own = (
        "modelDescription.xml",
        "model.png",
        "binaries/",
        "documentation/",
        "resources/slavemodule.txt",
        "resources/scene.json",
    )
    scripts = {"resources/structural_fmu.py", "resources/aero_fmu.py"}
    assert {name for name in different if not name.startswith(own)} == scripts
    assert f"resources/scene/{scene.name}/scene.toml" in structural
    resources = [name for name in structural if name.startswith("resources/")]
    assert not [name for name in resources if "__pycache__" in name or "/tests/" in name]
    assert {name.split("/")[2] for name in resources if name.startswith("resources/scene/")} == {scene.name}
    assert {name.rpartition(".")[2] for name in resources} <= {"py", "toml", "csv", "md", "txt", "json"}


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


def test_settings_travel_with_the_fmu(scene, scene_paths):
    assert [json.loads(entries(path)["resources/scene.json"])["settings"] for path in scene_paths] == [
        scene.settings
    ] * 2
