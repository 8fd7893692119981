"""Section polars of closed bodies: the profile drag of their strips, as [body] says it."""

import numpy as np
import pytest

import scenes
from scenes import SceneError
from tests.scenes.body_scenes import BOX, HEADER
from tests.scenes.mesh_files import msh2

WING = 'shape = "wing"\nprofile = "0012"\npanels = 16\nspan = 6.0\nchord = 1.0\nstrips = 4\n'
AERO = """
[aero]
method = "panel"
wind_speed = 10.0
wind_direction = [1.0, 0.0, 0.08]
reference_area = 6.0
symmetric = true
"""
STATIONS = f"{HEADER.strip()},polar\n0,0,0,1,0,0,0012,inner\n0,3,0,1,0,0,0012,outer\n"
TABLE = 'shape = "wing"\npanels = 16\nstrips = 4\nstations = "stations.csv"\npolars = "polars.csv"\n'


def curves(**drag):
    """polars.csv with cl = 5.5 alpha and an even cd, by name."""
    rows = ["polar,alpha_deg,cl,cd,cm"]
    for name, cd in drag.items():
        rows += [f"{name},{a},{5.5 * np.deg2rad(a):.9f},{cd},0.0" for a in range(-15, 16, 3)]
    return "\n".join(rows) + "\n"


def made(tmp_path, body, aero="", **files):
    folder = tmp_path / "closed_wing"
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        (folder / name.replace("_", ".")).write_text(content)
    (folder / "scene.toml").write_text(f'title = "closed wing"\n\n[body]\n{body}{AERO}{aero}')
    return scenes.load(folder)


def looked(scene):
    core = scene.aero_core()
    core.look()
    return core


def test_a_polar_of_even_drag_is_the_same_as_a_constant(tmp_path):
    with_polar = looked(made(tmp_path, WING + 'polars = "polars.csv"\n', polars_csv=curves(even=0.02)))
    constant = looked(made(tmp_path, WING, "profile_drag_coefficient = 0.02\n"))
    for name in ("profile_drag", "CD", "shear", "CL"):  # cubics through even tables are even to rounding
        assert with_polar.get(name) == pytest.approx(constant.get(name), rel=1e-12, abs=1e-12)
    assert int(with_polar.get("strips_beyond_polar")) == 0


def test_one_of_several_polars_is_named(tmp_path):
    text = WING + 'polars = "polars.csv"\npolar = "rough"\n'
    core = looked(made(tmp_path, text, polars_csv=curves(even=0.02, rough=0.05)))
    other = looked(made(tmp_path, WING, "profile_drag_coefficient = 0.05\n"))
    assert float(core.get("profile_drag")) == pytest.approx(float(other.get("profile_drag")), rel=1e-12)


def test_polars_change_linearly_between_two_stations_on_both_halves(tmp_path):
    scene = made(tmp_path, TABLE, stations_csv=STATIONS, polars_csv=curves(inner=0.01, outer=0.03))
    core = looked(scene)
    edges = scene.interface.nodes[scene.interface.trailing_edges]
    middle, width = np.abs(edges[:, :, 1].mean(axis=1)), np.abs(np.diff(edges[:, :, 1], axis=1))[:, 0]
    cd = 0.01 + 0.02 * middle / 3.0  # monotone cubics through two points are straight
    q = 0.5 * 1.225 * 100.0
    # strips of chord 1: from the line between two panels that is furthest from the trailing edge, the nose
    assert float(core.get("profile_drag")) == pytest.approx(q * cd @ width, rel=1e-12)
    assert np.array_equal(scene.wing_model._strips.ends, scene.interface.trailing_edges)  # in whose order polars are
    assert bool(core.get("symmetry_used"))


def test_polars_follow_the_stations_of_a_whole_wing_from_tip_to_tip(tmp_path):
    stations = f"{HEADER.strip()},polar\n0,-3,0,1,0,0,0012,left\n0,0,0,1,0,0,0012,middle\n0,3,0,1,0,0,0012,right\n"
    given = curves(left=0.01, middle=0.02, right=0.03)
    scene = made(tmp_path, TABLE, stations_csv=stations, polars_csv=given)
    y = scene.interface.nodes[scene.interface.trailing_edges][:, :, 1].mean(axis=1)
    cd = scene.strip_polars().all(np.zeros(len(y)))[1]
    assert cd == pytest.approx(0.02 + 0.01 * y / 3.0, rel=1e-12)


def test_a_box_wing_has_the_drag_of_its_polar_all_round(tmp_path):
    core = looked(made(tmp_path, BOX + 'polars = "polars.csv"\n', polars_csv=curves(even=0.02)))
    other = looked(made(tmp_path, BOX, "profile_drag_coefficient = 0.02\n"))
    assert float(core.get("profile_drag")) == pytest.approx(float(other.get("profile_drag")), rel=1e-12)


def test_strips_beyond_the_data_are_counted_and_keep_the_drag_of_its_end(tmp_path):
    scene = made(tmp_path, WING + 'polars = "polars.csv"\n', polars_csv=curves(even=0.02))
    core = scene.aero_core()
    core.set("wind_direction", [1.0, 0.0, np.tan(np.deg2rad(30.0))])
    core.step(0.0, 1.0)
    assert int(core.get("strips_beyond_polar")) > 0
    assert 0 < int(core.get("strips_beyond_polar_at")) <= 8
    assert float(core.get("outside_validity")) >= 1.0


@pytest.mark.parametrize(
    ("body", "files", "sentence"),
    [
        (WING + 'polar = "even"\n', {}, r"\[body\] polar names one of a table; give 'polars', its file, or drop it\."),
        (WING + 'polars = "polars.csv"\n', {}, r"polars.csv does not exist"),
        (
            WING + 'polars = "polars.csv"\n',
            {"polars_csv": curves(a=0.01, b=0.02)},
            r"has 2 polars, and .* does not say which one its strips have; name it in 'polar', or take a table",
        ),
        (
            WING + 'polars = "polars.csv"\npolar = "x"\n',
            {"polars_csv": curves(a=0.01)},
            r"\[body\] polar 'x' is not in closed_wing/polars.csv; add it or correct the name\.",
        ),
        (
            TABLE,
            {"polars_csv": curves(inner=0.01), "stations_csv": STATIONS},
            r"stations.csv row 3: polar 'outer' is not in closed_wing/polars.csv; add it",
        ),
        (
            TABLE,
            {"polars_csv": curves(inner=0.01), "stations_csv": STATIONS.replace(",polar", ",section")},
            r"stations.csv row 1 has no column 'polar'",
        ),
        (
            'shape = "mesh-file"\nmesh = "wedge.msh"\npolars = "polars.csv"\n',
            {"polars_csv": curves(a=0.01)},
            r"\[body\] polars are those of strips of quads, and .*; mesh it so, or drop them\.",
        ),
    ],
)
def test_what_is_wrong_with_polars_is_told_in_one_sentence(tmp_path, body, files, sentence):
    if "wedge.msh" in body:
        (tmp_path / "closed_wing").mkdir()
        points = [(0, -1, 0.1), (0, 1, 0.1), (0, -1, -0.1), (0, 1, -0.1), (1, -1, 0), (1, 1, 0)]
        sides = [(0, 4, 5), (0, 5, 1), (2, 5, 4), (2, 3, 5), (0, 1, 3), (0, 3, 2), (0, 2, 4), (1, 5, 3)]
        msh2(tmp_path / "closed_wing/wedge.msh", points, [(1, tuple(n + 1 for n in side)) for side in sides])
    with pytest.raises(SceneError, match=rf"^closed_wing/.*{sentence}"):
        made(tmp_path, body, **files)


def test_drag_that_is_said_twice_is_refused(tmp_path):
    text = WING + 'polars = "polars.csv"\n'
    with pytest.raises(SceneError, match=r"profile_drag_coefficient stands beside \[body\] polars, .*; drop one of"):
        made(tmp_path, text, "profile_drag_coefficient = 0.02\n", polars_csv=curves(even=0.02))


def test_the_files_of_the_scene_name_the_polars(tmp_path):
    scene = made(tmp_path, WING + 'polars = "polars.csv"\n', polars_csv=curves(even=0.02))
    assert "polars.csv" in scene.files
