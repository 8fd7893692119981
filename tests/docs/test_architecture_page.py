"""The page on architecture: its drawing has the arrows that the code may have, and its toys do what it says.

A toy is one file, given by the page, in a folder that the package of its kind looks into; nothing else is touched.
"""

import json
import re
import shutil
import sys
from importlib import import_module

import numpy as np
import pytest
from typer.testing import CliRunner

import aero.methods
import master.coupling.acceleration
import scenes
from interface import mirror_permutation
from master import IQNILS, fixed_point
from master.cli import app
from master.coupling import Coupling, solve
from master.coupling.schemes import SCHEMES, kinds
from structural import Assembly, FaceLoad, Faces, Loads, LoadSensitivity, Structure, equilibrium
from structural.dynamics import GeneralisedAlpha, Motion, integrate
from tests.docs.pages import DOCS, checked, give_files
from tests.structural.models import MIRROR, TANGENT_TOLERANCE, central_difference, residual_of
from tests.test_architecture import COMMAND_LINE_LAZY_ROOMS, MASTER_NEIGHBOURS, NEIGHBOURS

PAGE = DOCS / "architecture.md"


@pytest.fixture
def toys(tmp_path, monkeypatch):
    """A folder with the files that the page gives, where packages look for modules of their kind."""
    give_files(PAGE, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path / "structural/elements")])
    for package, folder in (
        (aero.methods, "aero/methods"),
        (master.coupling.acceleration, "master/coupling/acceleration"),
    ):
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path / folder)])
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if name.rpartition(".")[2] in ("cubic", "constant_pressure", "half"):
            del sys.modules[name]


def test_the_drawing_has_the_arrows_that_the_code_may_have():
    drawings = re.findall(r"```mermaid\n(.*?)```", PAGE.read_text(), re.DOTALL)
    drawn, within = (re.findall(r"^ +(\w+) (-->|-\.)(?: .*?\.->)? (\w+)$", text, re.MULTILINE) for text in drawings)
    assert {(a, b) for a, kind, b in drawn if kind == "-->"} == {(a, b) for a, to in NEIGHBOURS.items() for b in to}
    assert {b for a, kind, b in drawn if kind == "-."} == COMMAND_LINE_LAZY_ROOMS
    assert {(a, b) for a, _, b in within} == {(a, b) for a, to in MASTER_NEIGHBOURS.items() for b in to}


def test_what_the_page_runs_prints_what_it_says(toys):
    shutil.copytree(scenes.load("typical_section").folder, toys / "plate")
    wrong = checked(PAGE)
    assert not wrong, "\n".join(wrong)


# An element


def tripod(mirror=False):
    """Two pairs of cubic springs, images of each other, that hold two nodes tied by a spring across the plane."""
    CubicSprings = import_module("cubic").CubicSprings
    right = np.array([[0.3, 1.0, 1.0], [-0.4, 1.2, 0.8], [0.1, 0.5, 0.0]])
    nodes = np.concatenate([right, right * MIRROR])
    links = np.array([[0, 2], [1, 2], [3, 5], [4, 5], [2, 5]])
    l0 = 0.8 * np.linalg.norm(nodes[links[:, 0]] - nodes[links[:, 1]], axis=1)
    springs = CubicSprings(links, l0, np.array([900.0, 700.0, 900.0, 700.0, 400.0]))
    fixed = np.zeros((6, 3), bool)
    fixed[[0, 1, 3, 4]] = True
    faces = {"skin": Faces(np.array([[0, 1, 2], [3, 5, 4]]))}
    structure = Structure(nodes, fixed, (springs,), faces)
    dead = np.zeros((6, 3))
    dead[[2, 5]] = [[1.0, 0.5, -4.0], [1.0, -0.5, -4.0]]
    loads = Loads(dead, {"skin": FaceLoad(np.array([3.0, 3.0]))})
    return structure, loads, Assembly(structure, mirror_permutation(nodes) if mirror else None)


@pytest.mark.parametrize("mirror", [False, True])
def test_a_family_of_elements_has_exact_tangents_in_any_assembly(toys, mirror):
    structure, loads, assembly = tripod(mirror)
    r, prepared = residual_of(assembly, structure.groups, loads)
    q = assembly.unknowns.restrict(structure.nodes) + 0.05
    _, k, _ = assembly.residual_and_tangent(q, prepared)
    exact = central_difference(r, q)
    assert np.abs(k.toarray() - exact).max() <= TANGENT_TOLERANCE * np.abs(exact).max()


def test_a_family_of_elements_is_solved_whole_and_halved_and_differentiated(toys):
    structure, loads, whole = tripod()
    found = equilibrium(whole, loads, structure.nodes, atol=1e-10)
    half = equilibrium(tripod(True)[2], loads, structure.nodes, atol=1e-10)
    assert found.converged
    assert half.converged
    assert half.x == pytest.approx(found.x, abs=1e-11)  # residuals of 1e-10 N on some hundreds of N/m
    change = Loads(np.array([[0.0, 0, 0]] * 2 + [[0.0, 0, 1.0]] + [[0.0, 0, 0]] * 2 + [[0.0, 0, 1.0]]))
    moved = LoadSensitivity(whole, loads, found.x)(change)
    more = Loads(loads.dead + 1e-4 * change.dead, loads.on)
    assert moved == pytest.approx((equilibrium(whole, more, found.x, atol=1e-10).x - found.x) / 1e-4, rel=1e-3)


def test_a_family_of_elements_moves_and_keeps_its_energy(toys):
    CubicSprings = import_module("cubic").CubicSprings
    nodes = np.array([[0.0, 0, 0], [1.5, 0, 0]])
    spring = CubicSprings(np.array([[0, 1]]), np.array([1.0]), np.array([800.0]))
    structure = Structure(nodes, np.array([[True] * 3, [False, True, True]]), (spring,))
    motion = Motion(Assembly(structure), np.ones(2), Loads(np.zeros((2, 3))))
    swing = integrate(motion, motion.at(nodes), 0.2, GeneralisedAlpha(1.0), step=1e-4, energy=True)
    held = swing.balance.kinetic + swing.balance.elastic
    assert held == pytest.approx(0.25 * 800.0 * 0.5**4, rel=1e-5)  # J, to the square of the step
    assert swing.balance.kinetic > 1.0


# A model of the flow


@pytest.fixture
def plate(toys):
    """A copy of the typical section in the toy's flow."""
    folder = toys / "plate"
    shutil.copytree(scenes.load("typical_section").folder, folder)
    text = re.sub(r"^(induction|section_force) = .*\n", "", (folder / "scene.toml").read_text(), flags=re.MULTILINE)
    (folder / "scene.toml").write_text(text.replace('method = "vortex-step"', 'method = "constant-pressure"'))
    return folder


def test_a_model_of_the_flow_is_known_by_the_name_of_its_file(toys):
    assert "constant-pressure" in aero.methods.methods()
    folder = shutil.copytree(scenes.load("typical_section").folder, toys / "odd")
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(text.replace('"vortex-step"', '"panels"'))
    with pytest.raises(scenes.SceneError, match=r"method must be one of: constant-pressure, panel, vortex-step"):
        scenes.load(folder)


def test_a_model_of_the_flow_is_coupled_and_shown_without_a_word_elsewhere(plate):
    coupling = Coupling.in_process(scenes.load(plate), {"lift_pressure": 20.0})
    assert "shear" not in coupling.structural.blocks
    assert "alpha" not in coupling.aero.blocks
    result = solve(coupling, IQNILS())
    assert result.status == "converged"
    rise = result.displacement.reshape(-1, 3, 3)[:, :, 2]
    # half of the force at either edge; the plate turns by 4 mrad, whose square is left out
    assert rise[:, 0] == pytest.approx(20.0 / 2400.0, rel=1e-4)
    assert rise[:, 2] == pytest.approx(20.0 / 1600.0, rel=1e-4)
    assert coupling.aero.get("wing_area") == pytest.approx(1.0, rel=1e-6)
    run = CliRunner().invoke(app, ["run", str(plate), "--backend", "in-process", "--set", "lift_pressure=20"])
    assert run.exit_code == 0, run.output
    summary = json.loads((plate.parent / "results/plate/summary.json").read_text())
    assert summary["outputs"]["wing_area"] == pytest.approx(1.0, rel=1e-6)
    written = {path.name for path in (plate.parent / "results/plate").iterdir()}
    assert {"report.html", "shape.png", "wing.vtu", "panels.csv"} <= written
    assert not {"strips.png", "polars.png"} & written  # it has none


def test_a_model_of_the_flow_has_a_page_and_variables_of_its_own_in_an_fmu(plate):
    from fmus.aero_fmu import AeroFmu
    from fmus.documentation import page

    scene = scenes.load(plate)
    fmu = AeroFmu(AeroFmu.scene_core(scene), instance_name="plate")
    fmu.description = "plate"
    text = page(fmu, scene, "aero")
    assert "a constant pressure, in a uniform wind" in text
    assert "lift_pressure" in text
    assert "Strips:" not in text
    assert "Panels: index i of pressure[i]" in text
    described = {v.get("name") for v in fmu.to_xml().iter("ScalarVariable")}
    assert {"lift_pressure", "wing_area", "pressure[4]"} <= described


# A scheme


def test_a_scheme_is_known_by_its_name_and_solves(toys):
    assert list(kinds())[: len(SCHEMES)] == list(SCHEMES)  # and a new one comes last
    half = kinds()["half"]()
    result = fixed_point(np.cos, np.array([1.0]), half, atol=1e-12)
    assert result.converged
    assert result.x_tilde[0] == pytest.approx(np.cos(result.x_tilde[0]), abs=1e-12)
