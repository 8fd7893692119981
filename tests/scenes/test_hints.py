"""Slips that a table allows but a kite does not: refused with what to do, or named when a run ends badly."""

import pytest

import scenes
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


def test_lopsided_nodes_under_symmetry_are_solved_whole_and_said_to_be(tmp_path):
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
    _, asymmetry = built(folder)[1].hints()
    for word in words:
        assert word in asymmetry


def test_elements_far_off_their_rest_length_are_named_with_both_lengths(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    edited(folder, "lines.csv", "amain_right,25 0,4.297", "amain_right,25 0,42.97")
    core = built(folder)[1]
    core.set("power_tape_length", 31.29)
    misfits = " ".join(core.hints()[0])
    for word in ("amain_right has 42.970 m for 4.3", "power_tape has 31.290 m for"):
        assert word in misfits
    assert built("v3_kite")[1].hints()[1] == ""
