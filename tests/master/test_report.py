"""The files of a run: they hold what the run found, read on their own, and are the same whenever they are written."""

import dataclasses
import html.parser
import json
import subprocess
import sys

import meshio
import numpy as np
import pytest
from typer.testing import CliRunner

import master.report
import scenes
from aero import AeroModel
from master.cli import app
from master.coupling import SCHEMES, Coupling, coupled_run
from master.report import RESULTS, final_state, missing_libraries, summary, versions, write_report
from master.report.panels import panel_loads
from master.report.state import Surface
from master.report.vtk import wing_file

CHOICES = {
    "scheme": "iqn-ils",
    "backend": "in-process",
    "relaxation": None,
    "tolerance": 1e-5,
    "force_tolerance": 0.01,
    "max_iterations": 200,
    "stability": False,
    "report": True,
}


def flown(name, **given):
    """Scene, run and summary content of a scene at given parameters."""
    scene = scenes.load(name)
    run = coupled_run(Coupling.in_process(scene, given), SCHEMES["iqn-ils"](), stability=False)
    content = summary(run, {"scene": name, **CHOICES, "scene_settings": scene.settings, "parameters_set": given})
    return scene, run, {**content, "versions": versions()}


@pytest.fixture(scope="module")
def kite():
    return flown("v3_kite", wind_speed=8.0, power_tape_length=3.15)  # two lines are slack


@pytest.fixture(scope="module")
def plate():
    return flown("typical_section")


@pytest.fixture(scope="module")
def folder(kite, tmp_path_factory):
    out = tmp_path_factory.mktemp("kite")
    write_report(out, *kite)
    return out


def test_wing_file_gives_back_shape_displacement_and_what_was_exchanged(kite, folder):
    scene, run, _ = kite
    aero, mesh = run.blocks["aero"], meshio.read(folder / "wing.vtu")
    used = np.unique(scene.interface.panels)
    np.testing.assert_array_equal(mesh.points, (scene.interface.nodes + aero["displacement"])[used])
    # a difference of numbers of 10 m: to rounding
    np.testing.assert_allclose(mesh.point_data["displacement_m"], aero["displacement"][used], atol=1e-14)
    np.testing.assert_array_equal(used[mesh.cells_dict["quad"]], scene.interface.panels)
    np.testing.assert_array_equal(np.concatenate(mesh.cell_data["exchanged_pressure_Pa"]), aero["pressure"])
    np.testing.assert_array_equal(np.concatenate(mesh.cell_data["exchanged_shear_Pa"]), aero["shear"])


def test_structure_file_gives_back_every_leg_with_the_tension_of_its_element(kite, folder):
    scene, run, _ = kite
    blocks, mesh = run.blocks["structural"], meshio.read(folder / "structure.vtu")
    chains = [nodes for group in scene.members.chains for nodes in group.nodes]
    legs = np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in chains])
    np.testing.assert_array_equal(mesh.cells_dict["line"], legs)
    np.testing.assert_array_equal(mesh.points, blocks["position"])
    element = mesh.cell_data["element"][0] - 1
    np.testing.assert_array_equal(mesh.cell_data["tension_N"][0], blocks["tension"][element])
    assert len(np.unique(element[mesh.cell_data["slack"][0] == 1])) == int(blocks["slack_lines"]) > 0
    length = np.linalg.norm(mesh.points[legs[:, 1]] - mesh.points[legs[:, 0]], axis=1)
    whole = np.bincount(element, length)[element]
    np.testing.assert_allclose(mesh.cell_data["length_m"][0], whole, rtol=1e-14)
    tape = element == scene.members.names.index("power_tape")
    assert np.all(mesh.cell_data["rest_length_m"][0][tape] == 3.15)  # of the run, not of the scene
    # slack is what is shorter than its rest length
    one_way = mesh.cell_data["kind"][0] > 0
    short = whole <= mesh.cell_data["rest_length_m"][0]
    np.testing.assert_array_equal(mesh.cell_data["slack"][0] == 1, one_way & short)


def test_exposed_lines_carry_their_load(kite, folder):
    _, run, _ = kite
    mesh, aero = meshio.read(folder / "lines.vtu"), run.blocks["aero"]
    ends = mesh.points[mesh.cells_dict["line"]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.testing.assert_array_equal(mesh.cell_data["line_load_N_per_m"][0], aero["line_load"])
    force = mesh.cell_data["line_load_N_per_m"][0].T @ length
    np.testing.assert_allclose(force, aero["line_force"], atol=1e-12 * np.linalg.norm(aero["line_force"]))


def test_panel_that_repeats_its_last_index_is_a_triangle_in_its_place(tmp_path):
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]])
    panels = np.array([[0, 1, 2, 3], [1, 4, 2, 2], [4, 5, 2, 2], [0, 1, 2, 3]])
    pressure = np.array([1.0, 2.0, 3.0, 4.0])
    loads = panel_loads(nodes, panels, {"pressure": pressure})
    surface = Surface(nodes, nodes, panels, loads, np.zeros((0, 2), int), np.zeros(0), None)
    (tmp_path / "wing.vtu").write_bytes(wing_file(surface))
    mesh = meshio.read(tmp_path / "wing.vtu")
    assert [(c.type, len(c.data)) for c in mesh.cells] == [("quad", 1), ("triangle", 2), ("quad", 1)]
    np.testing.assert_array_equal(np.concatenate(mesh.cell_data["delta_p_Pa"]), pressure)
    np.testing.assert_array_equal(mesh.cells[1].data, panels[1:3, :3])


@pytest.mark.parametrize("name", ["kite", "plate"])
def test_strip_loads_add_up_to_the_aerodynamic_force(name, request):
    scene, run, _ = request.getfixturevalue(name)
    strips, aero = final_state(scene, run).strips, run.blocks["aero"]
    along = aero["wind_direction"] / np.linalg.norm(aero["wind_direction"])
    up = np.cross(along, [0.0, 1.0, 0.0])
    size = np.linalg.norm(aero["force"])  # rounding of sums of both signs
    assert strips.lift @ strips.width == pytest.approx(aero["force"] @ up / np.linalg.norm(up), abs=1e-12 * size)
    assert strips.drag @ strips.width == pytest.approx(aero["force"] @ along, abs=1e-12 * size)
    assert strips.side @ strips.width == pytest.approx(aero["force"][1], abs=1e-12 * size)
    np.testing.assert_allclose(strips.arc, -strips.arc[::-1], atol=1e-5)  # both wings alike: solver tolerance


class Page(html.parser.HTMLParser):
    """Checks that elements close in order; collects cells, addresses and text."""

    VOID = ("meta", "img", "br", "link")

    def __init__(self, text):
        super().__init__()
        self.open, self.addresses, self.marked, self.words, self.tags = [], [], [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.tags.append(tag)
        self.addresses += [v for k, v in attributes.items() if k in ("src", "href", "action", "data", "srcset")]
        if tag not in self.VOID:
            self.open.append((tag, attributes.get("class")))

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        self.words.append(data)
        if ("tr", "marked") in self.open:
            self.marked.append(data)


def test_page_is_whole_names_every_setting_and_needs_no_other_file(kite, folder):
    scene, run, content = kite
    text = (folder / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert text.startswith("<!DOCTYPE html>")
    assert all(address.startswith("data:image/svg+xml;base64,") for address in page.addresses)
    assert len(page.addresses) == 4
    for outside in ("http://", "https://", "url(", "@import", "<script", "<link"):
        assert outside not in text
    assert len(text) < 2e6
    words = set(page.words)
    names = [*CHOICES, *scene.settings, *content["outputs"], *content["versions"], *scene.members.names]
    names += [f"{label}.{b}" for label, c in run.causality.items() for b in c if c[b] == "parameter"]
    assert set(names) <= words
    for core in (scene.structural_core(), scene.aero_core()):
        assert {v.description for v in core.variables if v.causality == "parameter"} <= words


def test_page_marks_the_slack_lines(kite, folder):
    scene, run, _ = kite
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    slack = run.blocks["structural"]["tension"] <= 0.0
    two_way = np.concatenate([c.two_way for c in scene.members.chains])
    names = {scene.members.names[i] for i in np.flatnonzero(slack & ~two_way)}
    assert len(names) == 2
    beyond = {judgement.where for judgement in run.validity if not judgement.within}
    assert names == (set(page.marked) - beyond) & set(scene.members.names)


def test_page_has_no_side_force_of_a_symmetric_kite_and_its_angles_in_degrees(kite, folder):
    _, run, content = kite
    text = (folder / "report.html").read_text(encoding="utf-8")
    words = Page(text).words
    assert abs(content["outputs"]["CS"]) < 1e-12  # rounding
    assert words[words.index("CS") + 1] == "0"
    assert "angle of attack, deg" in words
    angle = np.rad2deg(run.result.history[-1]["aero.alpha_mid"])
    assert f"{angle:.6g}" in words
    assert f"rad ({np.rad2deg(float(run.blocks['aero']['alpha_mid'])):.3f} deg)" in words
    assert any("chord to the local flow with induced velocity" in w for w in words)


def test_page_shows_hostile_text_as_text(plate, tmp_path):
    scene, run, content = plate
    bad = dataclasses.replace(run, message="<script>alert(1)</script> & more", remarks=['"><img src=x>'])
    write_report(tmp_path, scene, bad, content)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "script" not in page.tags
    assert any("<script>alert(1)</script> & more" in words for words in page.words)


def test_run_that_did_not_converge_says_so_first(tmp_path):
    arguments = ["run", "v3_kite", "--backend", "in-process", "--max-iterations", "1", "--out", str(tmp_path)]
    assert CliRunner().invoke(app, arguments).exit_code == 1
    words = [w.strip() for w in Page((tmp_path / "report.html").read_text(encoding="utf-8")).words if w.strip()]
    title = next(i for i, w in enumerate(words) if "38 nodes" in w and "not" not in w)
    assert words[title + 1] == "not converged (max iterations)"


def test_scene_without_strips_leaves_out_what_shows_them(plate, tmp_path):
    scene, run, content = plate
    write_report(tmp_path, scene, run, content)
    assert (tmp_path / "polars.png").exists()
    aero = {k: v for k, v in run.blocks["aero"].items() if k not in ("alpha", "circulation")}
    structural = {k: v for k, v in run.blocks["structural"].items() if k != "position"}
    bare = dataclasses.replace(run, blocks={"aero": aero, "structural": structural})
    of_panels = dataclasses.replace(scene)
    vars(of_panels)["wing_model"] = AeroModel()  # one that has no strips
    written = write_report(tmp_path / "bare", of_panels, bare, content)
    assert not {"strips.png", "polars.svg", "structure.vtu"} & set(written)
    assert sorted(p.name for p in (tmp_path / "bare").iterdir()) == sorted(written)


def test_two_writes_give_the_same_bytes_whatever_the_settings_of_the_user(kite, folder, tmp_path):
    import matplotlib

    with matplotlib.rc_context({"font.size": 20.0, "svg.hashsalt": None, "lines.linewidth": 9.0}):
        written = write_report(tmp_path, *kite)
        assert matplotlib.rcParams["font.size"] == 20.0  # and these are back
    assert set(written) <= set(RESULTS)
    for name in written:
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name


def test_failed_drawing_leaves_no_part_of_a_report(plate, tmp_path, monkeypatch):
    import master.report.vtk

    def full(*_):
        raise OSError("disk full")

    monkeypatch.setattr(master.report.vtk, "_vtu", full)
    with pytest.raises(OSError, match="disk full"):
        write_report(tmp_path, *plate)
    assert not any(tmp_path.iterdir())


def _run(tmp_path, *more):
    arguments = ["run", "typical_section", "--backend", "in-process", "--out", str(tmp_path), *more]
    return CliRunner().invoke(app, arguments)


def test_command_line_writes_all_files_and_names_them(tmp_path):
    result = _run(tmp_path)
    assert result.exit_code == 0, result.output
    named = result.stdout.rpartition("written: ")[2].strip().replace(f"{tmp_path}/", "").split(", ")
    assert sorted(named) == sorted(p.name for p in tmp_path.glob("[!.]*"))
    assert {"summary.json", "shape.png", "shape.svg", "wing.vtu", "structure.vtu", "report.html"} <= set(named)


def test_without_the_libraries_the_run_keeps_its_tables_and_says_what_to_install(tmp_path, monkeypatch):
    _run(tmp_path)
    monkeypatch.setattr(master.report, "find_spec", lambda name: None if name == "meshio" else name)
    sentence = missing_libraries()
    assert "meshio is not installed" in sentence
    assert "pip install 'kitecosim[report]'" in sentence
    result = _run(tmp_path)
    assert result.exit_code == 0
    assert sentence in result.stdout
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "converged"
    assert not (tmp_path / "report.html").exists()  # that of the first run is gone
    with pytest.raises(ModuleNotFoundError, match="pip install"):
        write_report(tmp_path, None, None, {})


def test_nothing_that_draws_is_loaded_without_a_report(tmp_path):
    script = (
        "import sys\n"
        "from typer.testing import CliRunner\n"
        "import master.report\n"
        "from master.cli import app\n"
        "arguments = ['run', 'typical_section', '--backend', 'in-process', '--no-report']\n"
        f"arguments += ['--out', {str(tmp_path)!r}]\n"
        "result = CliRunner().invoke(app, arguments)\n"
        "assert result.exit_code == 0, result.output\n"
        "print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert not {"matplotlib", "meshio", "jinja2", "PIL"} & set(done.stdout.split())
    kinds = {path.suffix for path in tmp_path.iterdir()}
    assert kinds == {".csv", ".json"}
