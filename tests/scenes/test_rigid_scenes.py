"""Scenes without a structure: a rigid wing in a flow, from the table to the core, and what is refused of them."""

import json
import re
import time

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from master.coupling import Coupling
from tests.scenes.broken import copy_of, edited
from tests.scenes.rigid import flat_wing, rigid_v3

TOTALS = ("CL", "CD", "CS", "force", "moment", "glide_ratio", "alpha", "circulation", "pressure", "shear")


@pytest.fixture(scope="module")
def rigid(tmp_path_factory):
    return rigid_v3(tmp_path_factory.mktemp("rigid"))


def test_the_wing_of_a_kite_alone_has_the_loads_of_the_kite_on_its_design_shape(rigid):
    alone = scenes.load(rigid).aero_core()
    # 4 strips a bay of 9 are those between the 37 sections
    kite = scenes.load("v3_kite", {"chord": "design", "panels_per_section": 4, "line_drag": "off"}).aero_core()
    for core in (alone, kite):
        core.step(0.0, 1.0)
    for name in TOTALS:
        np.testing.assert_array_equal(alone.get(name), kite.get(name), name)  # the same arithmetic on the same nodes


def test_it_has_an_aerodynamic_side_alone(rigid):
    scene = scenes.load(rigid)
    assert not scene.has_structure
    assert list(scene.cores()) == ["aero"]
    assert scene.symmetric
    assert (scene.pivot, scene.trim_angle(), scene.notes(), scene.hints()) == (None, 0.0, [], ([], ""))
    assert scene.files == ("scene.toml", "sections.csv", "polars.csv")
    with pytest.raises(scenes.SceneError, match=r"^scene 'rigid_v3' has no structure.*\.$"):
        scene.structural_core()
    with pytest.raises(ValueError, match=r"^scene 'rigid_v3' is a rigid wing.*nothing to couple"):
        Coupling.in_process(scene)


def test_strips_between_two_sections_are_as_many_as_are_asked_for(rigid):
    for count in (1, 3):
        scene = scenes.load(rigid, {"panels_per_section": count})
        assert len(scene.interface.sections) == 36 * count + 1
        ends = scene.interface.nodes[scene.interface.sections[[0, -1]]]
        np.testing.assert_allclose(
            ends, scenes.load(rigid).interface.nodes.reshape(-1, 3, 3)[[0, -1]], rtol=0, atol=1e-15
        )


def test_coefficients_do_not_depend_on_the_scale(rigid):
    found = []
    for scale in (1.0, 2.0):
        core = scenes.load(rigid, {"scale": scale}).aero_core()
        core.step(0.0, 1.0)
        found.append([float(core.get("CL")), float(core.get("CD")), *core.get("moment") / scale**3])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-9)  # what Newton's method leaves


def test_moments_are_about_the_reference_point(tmp_path):
    point = np.array([0.3, 0.0, -2.0])
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    about_origin = scenes.load(flat_wing(tmp_path / "a", twist=0.1)).aero_core()
    about_point = scenes.load(flat_wing(tmp_path / "b", twist=0.1, point=point)).aero_core()
    for core in (about_origin, about_point):
        core.step(0.0, 1.0)
    force = about_origin.get("force")
    expected = about_origin.get("moment") - np.cross(point, force)
    scale = np.linalg.norm(force) * 2.0
    np.testing.assert_allclose(about_point.get("moment"), expected, rtol=0, atol=1e-12 * scale)  # rounding of sums
    (moment,) = (v for v in about_point.variables if v.name == "moment")
    assert moment.description.endswith("about the reference point")


@pytest.mark.parametrize("backend", ["in-process", "fmu"])
def test_a_run_solves_the_flow_once_and_leaves_results(rigid, backend, tmp_path):
    words = ["run", str(rigid), "--backend", backend, "--out", str(tmp_path)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    content = json.loads((tmp_path / "summary.json").read_text())
    assert content["status"] == "converged"
    assert (content["scheme"], content["backend"]) == (None, backend)
    assert (content["coupling_iterations"], content["residual"], content["residual_N"]) == (0, None, None)
    assert content["solver_calls"] == {"structural": 0, "aero": 1}
    core = scenes.load(rigid).aero_core()
    core.step(0.0, 1.0)
    for name in ("CL", "CD", "glide_ratio"):
        assert content["outputs"][name] == float(core.get(name))
    assert {j["output"] for j in content["validity"]} >= {"aero.stalled_strips", "aero.reference_area_misfit"}
    written = {path.name for path in tmp_path.iterdir() if path.is_file()}
    assert {"interface.csv", "panels.csv", "shape.png", "strips.png", "polars.png", "wing.vtu"} <= written
    assert not written & {"history.csv", "convergence.png", "structure.vtu", "nodes.csv", "elements.csv"}
    assert "coupling iteration" not in (tmp_path / "report.html").read_text()
    assert "no structure" in result.output


@pytest.mark.parametrize("backend", ["in-process", "fmu"])
def test_the_time_of_a_run_is_that_of_its_one_solve(backend, tmp_path):
    """Of an FMU too, which solves the flow when it is initialised: it takes as long as in this process, not nothing."""
    core = scenes.load("box_wing", {"variant": "sketch"}).aero_core()
    begin = time.perf_counter()
    core.step(0.0, 1.0)
    took = time.perf_counter() - begin
    words = ["run", "box_wing", "--set", "variant=sketch", "--backend", backend, "--no-report", "--out", str(tmp_path)]
    assert CliRunner().invoke(app, words).exit_code == 0
    wall = json.loads((tmp_path / "summary.json").read_text())["wall_time_s"]
    assert wall["total"] == wall["aero"] > 0.1 * took  # a step that finds the flow solved takes a thousandth
    assert wall["set_up"] > 0.0


def test_a_flow_without_an_answer_is_a_result_that_did_not_converge(tmp_path):
    path = flat_wing(tmp_path, sections=5)
    # sections whose lift jumps: no circulation balances it
    edited(path, "polars.csv", "thin,5.0,0.548311355616,", "thin,5.0,-400.0,")
    words = ["run", str(path), "--set", "wind_direction=1,0,0.08748866352592401", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, [*words, "--backend", "in-process"])
    assert result.exit_code == 1, result.output
    content = json.loads((tmp_path / "out/summary.json").read_text())
    assert content["status"] == "diverged"
    assert "no answer" in content["message"]
    assert content["outputs"]["CL"] is None
    assert content["validity"] == []
    assert (tmp_path / "out/report.html").exists()


def test_it_says_what_it_needs(rigid):
    result = CliRunner().invoke(app, ["scenes", str(rigid)])
    assert result.exit_code == 0, result.output
    assert "rigid: a flow around the wing alone" in result.output
    assert "parameter symmetric = 1" in result.output
    assert "gravity" not in result.output


OPTIONS = {
    "scheme": ["--scheme", "aitken"],
    "order": ["--order", "parallel"],
    "tolerance": ["--tolerance", "1e-3"],
    "force-tolerance": ["--force-tolerance", "1"],
    "max-iterations": ["--max-iterations", "3"],
    "relaxation": ["--scheme", "relaxation", "--relaxation", "0.5"],
    "no-stability": ["--no-stability"],
    "labels": ["--labels", "nodes"],
    "checkpoint": ["--checkpoint", "x.ckpt"],
    "live": ["--live"],
    "stop-time": ["--stop-time", "1"],
}


@pytest.mark.parametrize("option", OPTIONS)
def test_an_option_that_says_how_to_couple_is_refused_in_one_sentence(rigid, option, tmp_path):
    words = ["run", str(rigid), "--backend", "in-process", *OPTIONS[option], "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2
    (line,) = result.stderr.strip().splitlines()
    assert "rigid_v3" in line
    assert line.endswith(".")
    assert not (tmp_path / "out").exists()


def test_schemes_have_nothing_to_compare_in_it(rigid, tmp_path):
    result = CliRunner().invoke(app, ["compare", str(rigid), "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "nothing to couple" in result.stderr


# what is wrong: (old, new, words that the message must hold)
WRONG = {
    "trim": ("[wing]", "[trim]\nlowest_deg = 0.0\n\n[wing]", ["[trim]", "[structure]"]),
    "dynamics": ("[wing]", "[dynamics]\nstop_time = 1.0\n\n[wing]", ["[dynamics]", "[structure]"]),
    "struts": ("[wing]", '[wing]\nstruts = "struts.csv"', ["[wing] struts", "[structure]"]),
    "drag of lines": ("[aero]", "[aero]\nline_normal_drag = 1.0", ["[aero] line_normal_drag", "lines"]),
    "friction of lines": ("[aero]", "[aero]\nline_friction = 0.01", ["[aero] line_friction", "lines"]),
    "setting of a structure": (
        "[settings.scale]",
        '[settings.chord]\ndefault = "design"\noptions = ["design"]\n\n[settings.scale]',
        ["[settings.chord]", "rigid"],
    ),
    "camber that nothing changes": (
        "[settings.scale]",
        '[settings.camber_feedback]\ndefault = "on"\noptions = ["on"]\n\n[settings.scale]',
        ["[settings.camber_feedback]", "rigid"],
    ),
    "no reference area": ("reference_area = 19.753\n", "", ["[aero]", "reference_area"]),
    "no flow": ("[aero]", "[variants.x.aero]", ["lacks", "[aero]"]),
    "no wing": ("[wing]", "[variants.x.wing]", ["[wing]"]),
    "point that is none": ("[aero]", "[aero]\nreference_point = [1.0, 2.0]", ["reference_point", "three"]),
    "chord of nothing": ("[aero]", "[aero]\nreference_chord = 0.0", ["reference_chord", "above 0"]),
    "symmetric in words": ("symmetric = true", 'symmetric = "yes"', ["symmetric", "true or false"]),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_means_nothing_to_a_rigid_wing_is_refused_in_one_sentence(wrong, tmp_path):
    old, new, words = WRONG[wrong]
    path = rigid_v3(tmp_path)
    edited(path, "scene.toml", old, new)
    with pytest.raises(scenes.SceneError) as caught:
        scenes.load(path).cores()
    message = str(caught.value)
    assert message.startswith("rigid_v3/scene.toml")
    assert "\n" not in message
    assert message.endswith(".")
    assert ";" in message or "must" in message  # the remedy follows the finding
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("key", "words"),
    [("symmetric = true", ["[aero] symmetric", "[structure]"]), ("reference_point = [0.0, 0.0, 1.0]", ["pivot"])],
)
def test_what_a_structure_says_is_not_said_of_its_flow_again(key, words, tmp_path):
    path = copy_of("v3_kite", tmp_path)
    edited(path, "scene.toml", "[aero]", f"[aero]\n{key}")
    with pytest.raises(scenes.SceneError) as caught:
        scenes.load(path)
    assert all(word in str(caught.value) for word in words)


def test_a_variant_can_bring_the_structure(tmp_path):
    """The same folder is a rigid wing in one variant and a kite in the other."""
    path = copy_of("v3_kite", tmp_path)
    text = (path / "scene.toml").read_text()
    for setting in ("chord", "line_drag"):
        text = re.sub(rf"(?ms)^\[settings\.{setting}\]\n.*?(?=^\[)", "", text)
    text = text.replace("[structure", "[variants.flown.structure").replace("[trim]", "[variants.flown.trim]")
    text = text.replace('struts = "struts.csv"\n', "")
    text += '\n[variants.flown.wing]\nstruts = "struts.csv"\n\n[variants.rigid.aero]\nsymmetric = true\n'
    text += '\n[settings.variant]\ndefault = "rigid"\noptions = ["rigid", "flown"]\n'
    (path / "scene.toml").write_text(text)
    assert list(scenes.load(path).cores()) == ["aero"]
    assert list(scenes.load(path, {"variant": "flown"}).cores()) == ["structural", "aero"]
