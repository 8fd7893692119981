"""Scenes with membranes as FMUs: bitwise the same solver, and its code only where there are membranes."""

import json
import zipfile

import numpy as np
import pytest

import scenes
from fmus.builder import MEMBRANES, build
from master.coupling import SCHEMES, Coupling, FmuParticipant, solve
from master.coupling.participants import InProcessParticipant
from master.coupling.participants.zero_loads import ZeroLoads

CASES = [("airbag", {"cells": 3}), ("airbag", {"cells": 2, "order": 2}), ("hencky", {"cells": 4})]


@pytest.fixture(scope="module", params=CASES, ids=str)
def pair(request, tmp_path_factory):
    """A scene and its FMU, which stands alone."""
    scene = scenes.load(*request.param)
    (path,) = build(scene, tmp_path_factory.mktemp("fmus"))
    return scene, path


def test_the_fmu_gives_bitwise_what_the_core_gives(pair):
    scene, path = pair
    shapes = []
    with FmuParticipant(path) as structural:
        for both in (Coupling(structural, ZeroLoads.beside(structural)), Coupling.in_process(scene)):
            result = solve(both, SCHEMES["iqn-ils"]())
            assert result.status == "converged"
            shapes.append({name: both.structural.get(name) for name in both.structural.blocks})
    for name, values in shapes[0].items():
        assert values.tobytes() == shapes[1][name].tobytes(), name


def test_a_pressure_is_tuned_between_steps_and_a_state_goes_back(pair):
    scene, path = pair
    with FmuParticipant(path) as fmu:
        core = InProcessParticipant(scene.structural_core())
        seen = []
        for side in (fmu, core):
            side.step(0.0, 1.0)
            state = side.save()
            first = side.get("position")
            side.set("inner_pressure", np.array(300.0))
            side.set("pressure", np.full(side.blocks["pressure"], 20.0))
            side.step(1.0, 1.0)
            second = side.get("position")
            side.restore(state)
            side.set("inner_pressure", np.array(300.0))
            side.set("pressure", np.full(side.blocks["pressure"], 20.0))
            side.step(1.0, 1.0)
            assert side.get("position").tobytes() == second.tobytes()
            seen.append((first, second))
        assert np.abs(seen[0][0] - seen[0][1]).max() > 1e-3  # m, the pressures differ by much
        for ours, theirs in zip(*seen, strict=True):
            assert ours.tobytes() == theirs.tobytes()


def test_the_code_of_membranes_is_in_their_fmus_only(pair, tmp_path):
    (plate, *_) = build(scenes.load("typical_section"), tmp_path)
    for path, there in ((pair[1], True), (plate, False)):
        with zipfile.ZipFile(path) as archive:
            inside = [name.partition("resources/")[2].partition("/")[2] for name in archive.namelist()]
        for begin in MEMBRANES:
            assert any(name.startswith(begin) for name in inside) is there, begin


def test_the_fmu_carries_the_mesh_as_plain_data_and_its_page_names_what_indices_count(pair):
    scene, path = pair
    with zipfile.ZipFile(path) as archive:
        content = json.loads(archive.read("resources/scene.json"))
        page = archive.read("documentation/index.html").decode()
        text = archive.read("modelDescription.xml").decode()
    held = content["scene"]["fields"]["members"]["fields"]["membranes"]
    assert held["of"] == "scenes.members:MembraneMesh"
    mesh = scene.members.membranes
    assert f"{len(mesh.group)} triangles of membranes" in page
    for words in ("Membrane elements: index i", "Groups of supports: index i", "Sides of seams: index i"):
        assert words in page
    assert "larger principal stress (2nd Piola-Kirchhoff) in force per length of the pattern of membrane_1" in text
    assert f"of support {mesh.supports[0].name}, z" in text
