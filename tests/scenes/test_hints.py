"""Slips that a table allows but a kite does not: refused with what to do, or named when a run ends badly."""

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from fmus.builder import build
from master.cli import app
from master.coupling import Coupling
from tests.scenes.broken import built, copy_of, edited

TOML = "scene.toml"


def trimmed(scene):
    """The trim angle of a scene."""
    return built(scene)[0].trim_angle()


def _refused(scene, trim=False):
    """The one sentence that refuses a scene."""
    with pytest.raises(scenes.SceneError) as caught:
        (trimmed if trim else built)(scene)
    return str(caught.value)


def test_setting_that_nothing_reads_is_refused_with_those_that_have_a_meaning(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, TOML, "[settings.panels_per_section]", "[settings.panel_per_section]")
    message = _refused(folder)
    for word in (TOML, "panel_per_section", "panels_per_section", "line_drag"):
        assert word in message


def test_sections_from_right_to_left_are_refused(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    header, *rows = (folder / "sections.csv").read_text().splitlines()
    (folder / "sections.csv").write_text("\n".join([header, *rows[::-1]]) + "\n")
    assert "sections.csv" in _refused(folder)


def test_asymmetric_nodes_under_symmetry_are_solved_whole_and_said_to_be(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, "nodes.csv", "4.07190711", "4.07190712")
    core = built(folder)[1]
    assert (bool(core.get("symmetric")), bool(core.get("symmetry_used"))) == (True, True)  # 1e-8 m is no asymmetry
    edited(folder, "nodes.csv", "4.07190712", "4.08")
    core = built(folder)[1]
    assert (bool(core.get("symmetric")), bool(core.get("symmetry_used"))) == (True, False)


def test_misspelt_parameter_is_refused_by_trim_and_coupling():
    scene = scenes.load("v3_kite")
    with pytest.raises(scenes.SceneError, match="wind_sped"):
        scene.trim_angle({"wind_sped": 9.0})
    with pytest.raises(ValueError, match="wind_sped"):
        Coupling.in_process(scene, {"wind_sped": 9.0})


def test_struts_that_point_upwind_are_refused(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    text = (folder / "struts.csv").read_text().replace("leading_edge_node,trailing", "trailing_edge_node,leading")
    (folder / "struts.csv").write_text(text)
    message = _refused(folder)
    for word in ("struts.csv row 2", "upwind", "swap"):
        assert word in message


def test_kite_that_finds_no_trim_angle_is_told_its_weight_and_lift(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, "masses.csv", "kcu,0,8.4", "kcu,3,8400.0")  # grams for kilograms, and on the wing
    message = _refused(folder, trim=True)
    for word in ("no trim angle", "N of weight", "N of lift", "masses"):
        assert word in message


def test_table_with_semicolons_is_told_so(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    (folder / "lines.csv").write_text((folder / "lines.csv").read_text().replace(",", ";"))
    assert "semicolons" in _refused(folder)


def test_polar_in_radians_is_refused(tmp_path):
    folder = copy_of("typical_section", tmp_path)
    edited(folder, "polars.csv", "plate,-90.0", "plate,-1.5708")
    edited(folder, "polars.csv", "plate,90.0", "plate,1.5708")
    assert "radians" in _refused(folder)


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("lines.csv", "A5_right,3 21,2.782", "A5_right,3 21,2.783", ["rest length", "A5_right", "A5_left", "2.783"]),
        ("nodes.csv", "4.07190711", "4.08", ["node 1 ", "no mirror image"]),
        (
            "springs.csv",
            "strut_1_right,1 2,1.074728,2000.0",
            "strut_1_right,1 2,1.074728,2001.0",
            ["stiffness", "2001"],
        ),
    ],
)
def test_what_breaks_the_symmetry_is_named(file, old, new, words, tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, file, old, new)
    _, asymmetry = scenes.load(folder).hints()
    for word in words:
        assert word in asymmetry


def test_elements_far_off_their_rest_length_are_named_with_both_lengths(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, "lines.csv", "amain_right,25 0,4.297", "amain_right,25 0,42.97")
    misfits = " ".join(scenes.load(folder).hints({"power_tape_length": 31.29})[0])
    for word in ("amain_right has 42.970 m for 4.3", "power_tape has 31.290 m for"):
        assert word in misfits
    assert scenes.load("v3_kite").hints()[1] == ""


def test_asymmetric_masses_are_named(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, "masses.csv", "pulley_a6_left,19,0.1", "pulley_a6_left,19,0.2")
    asymmetry = scenes.load(folder).hints()[1]
    for word in ("mass at node", "19"):
        assert word in asymmetry


def test_one_node_too_many_is_named_by_its_place(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    row = next(r for r in (folder / "nodes.csv").read_text().splitlines() if r.startswith("21,"))
    edited(folder, "nodes.csv", row, f"{row}\nextra{row[2:]}")
    edited(
        folder,
        "lines.csv",
        "A5_right,3 21,2.782",
        "A5_right,3 21,2.782,0.002\nloop,21 extra,0.1,0.002\nloop_2,3 extra,2.782",
    )
    asymmetry = scenes.load(folder).hints()[1]
    for word in ("more nodes", "21"):
        assert word in asymmetry


def test_a_run_that_loses_its_symmetry_says_why_and_leaves_foreign_files_alone(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, "lines.csv", "A5_right,3 21,2.782", "A5_right,3 21,2.783")
    foreign = tmp_path / "out" / "fmus" / "glider_aero.fmu"
    own = tmp_path / "out" / "fmus" / "v3_kite_aero.fmu"
    foreign.parent.mkdir(parents=True)
    foreign.write_text("of somebody else")
    words = ["run", str(folder), "--no-report", "--out", str(tmp_path / "out"), "--max-iterations", "3"]
    assert CliRunner().invoke(app, words).exit_code == 1
    assert own.exists()
    done = CliRunner().invoke(app, [*words, "--backend", "in-process"])
    assert done.exit_code == 1
    assert "not symmetric: rest length of A5_right is 2.783" in " ".join(done.output.split())
    assert (foreign.exists(), own.exists()) == (True, False)


def test_trim_angle_is_found_unless_it_is_given():
    kite, plate = scenes.load("v3_kite"), scenes.load("typical_section")
    wind = {"wind_speed": 9.0}
    assert kite.with_trim(wind) == {**wind, "trim_angle": kite.trim_angle(wind)}
    assert wind == {"wind_speed": 9.0}
    assert kite.with_trim({**wind, "trim_angle": 0.3})["trim_angle"] == 0.3
    assert plate.with_trim(wind) == wind
    with pytest.raises(scenes.SceneError, match="no trim angle"):
        Coupling.in_process(kite, {"wind_speed": 1.5})


@pytest.mark.parametrize("value", [None, [1.0, 2.0], np.array([9.81]), "x", float("nan"), 1e9], ids=str)
@pytest.mark.parametrize("entry", ["in_process", "build", "trim_angle"])
def test_bad_values_are_refused_in_one_sentence_before_anything_is_trimmed(entry, value, tmp_path):
    kite = scenes.load("v3_kite")
    call = {
        "in_process": lambda given: Coupling.in_process(kite, given),
        "build": lambda given: build(kite, tmp_path, given),
        "trim_angle": kite.trim_angle,
    }[entry]
    with pytest.raises(ValueError, match="gravity"):
        call({"gravity": value})


def test_stalled_strips_are_counted_beyond_their_stall_also_where_lift_rises_again():
    kite = scenes.load("v3_kite", {"chord": "design"})
    air = kite.aero_core()
    counts = []
    for degrees in (5.0, 25.0, 40.0):
        a = np.deg2rad(degrees)
        air.set("wind_direction", [np.cos(a), 0.0, np.sin(a)])
        air.step(0.0, 0.0)
        low, high = kite.strip_polars().stall_angles()
        beyond = (air.get("alpha") > high) | (air.get("alpha") < low)
        counts.append(int(air.get("stalled_strips")))
        assert counts[-1] == np.count_nonzero(beyond)
    assert counts[0] == 0
    assert min(counts[1:]) >= 5
