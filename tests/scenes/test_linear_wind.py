"""[aero.linear_wind] and [aero.rotation] of scene.toml: a wind that is linear in space, as a scene says it."""

import numpy as np
import pytest

import scenes
from interface import StepFailed
from interface.vectors import azimuth_axes
from master.report.panels import panel_loads
from scenes import SceneError
from tests.scenes.broken import copy_of, edited
from tests.scenes.rigid import flat_wing

GROUND = "[aero.linear_wind]\nground = [-30.0, 0.0, -100.0]\n"
TURN = "[aero.rotation]\nrate = [0.1, 0.2, -0.3]\ncentre = [0.0, 5.0, -20.0]\n"
WIDTH, LENGTH, DRAG = 0.5 * 1.225 * 0.004, 300.0, 1.22  # rho d / 2 kg/m2, m and C_tau of tether_in_wind


def wing(tmp_path, more="", **given):
    core = scenes.load(flat_wing(tmp_path, aero=more, **{"twist": 0.1, **given})).aero_core()
    core.look()
    return core


def append(folder, table):
    file = folder / "scene.toml"
    file.write_text(f"{file.read_text()}\n{table}")


def tether(tmp_path, table):
    folder = copy_of("tether_in_wind", tmp_path)
    append(folder, table)
    return scenes.load(folder).aero_core()


def test_a_tether_held_at_the_ground_has_a_third_of_the_drag_also_in_a_gust(tmp_path):
    core = tether(tmp_path, "[aero.linear_wind]\nground = [0.0, 0.0, 0.0]\nkite = [0.0, 0.0, 300.0]\n")
    core.step(0.0, 1.0)
    assert core.get("line_force")[0] == pytest.approx(WIDTH * DRAG * LENGTH * 36.0 / 3.0, rel=1e-12)
    for name, value in {"gust_speed": 3.0, "gust_start": 1.0, "gust_duration": 4.0}.items():
        core.set(name, value)
    core.step(1.0, 2.0)  # in the middle of the gust, 9 m/s at the kite: the whole profile grows with it
    assert core.get("line_force")[0] == pytest.approx(WIDTH * DRAG * LENGTH * 81.0 / 3.0, rel=1e-12)
    assert core.get("wind_gradient")[0] == pytest.approx([0.0, 0.0, 9.0 / 300.0], rel=1e-14)
    assert core.get("wind_at_origin") == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_tether_that_turns_about_the_ground_meets_the_wind_less_its_own_motion(tmp_path):
    # 0.02 rad/s about y is 6 m/s downwind at 300 m: no wind is left there, all of it at the ground, and again 1/3
    core = tether(tmp_path, "[aero.rotation]\nrate = [0.0, 0.02, 0.0]\ncentre = [0.0, 0.0, 0.0]\n")
    core.step(0.0, 1.0)
    assert core.get("line_force")[0] == pytest.approx(WIDTH * DRAG * LENGTH * 36.0 / 3.0, rel=1e-12)
    # and it is what lines do that move so: the wind of an interface that has these velocities itself
    plain = scenes.load("tether_in_wind").aero_core()
    nodes = scenes.load("tether_in_wind").interface.nodes
    plain.set("velocity", np.cross([0.0, 0.02, 0.0], nodes))
    plain.step(0.0, 1.0)
    # one point a line against two: (1 - 1/n)(1 - 1/2n).. of order 1 / 4 n^2 of a third, n = 24
    assert plain.get("line_force")[0] == pytest.approx(core.get("line_force")[0], rel=1.0 / (4.0 * 24**2) * 1.01)


def test_a_share_of_one_at_the_ground_is_the_uniform_wind_to_the_last_bit(tmp_path):
    (tmp_path / "a").mkdir()
    plain, same = wing(tmp_path / "a"), wing(tmp_path, GROUND + "ground_share = 1.0\n")
    for variable in plain.variables:
        assert np.array_equal(plain.get(variable.name), same.get(variable.name)), variable.name


def test_the_wind_has_its_speed_at_the_point_that_moments_are_about(tmp_path):
    core = wing(tmp_path, GROUND, point=(2.0, 0.0, 1.0))
    at = core.get("wind_at_origin") + core.get("wind_gradient") @ [2.0, 0.0, 1.0]
    assert at == pytest.approx([10.0, 0.0, 0.0], abs=1e-13)
    assert core.get("wind_at_origin") + core.get("wind_gradient") @ [-30.0, 0.0, -100.0] == pytest.approx(
        np.zeros(3), abs=1e-13
    )


@pytest.mark.parametrize("azimuth", [0.6, np.pi / 2.0, 4.0])
def test_a_scene_turned_with_its_wind_and_ground_is_the_same(tmp_path, azimuth):
    def made(folder, angle):
        turn = azimuth_axes(angle)
        ground, rate, centre = (
            (turn @ v).tolist() for v in ([-30.0, 4.0, -100.0], [0.1, 0.2, -0.3], [0.0, 5.0, -20.0])
        )
        folder.mkdir()
        return wing(
            folder,
            f"[aero.linear_wind]\nground = {ground}\n[aero.rotation]\nrate = {rate}\ncentre = {centre}\n",
            azimuth=angle,
            sweep=0.3,
        )

    one, other = made(tmp_path / "a", 0.0), made(tmp_path / "b", azimuth)
    for name in ("CL", "CD", "CS"):
        assert float(other.get(name)) == pytest.approx(float(one.get(name)), abs=1e-10)  # rounding of tables, 1e-13
    assert other.get("moment") == pytest.approx(azimuth_axes(azimuth) @ one.get("moment"), abs=1e-7)  # of some 1e3 N m


def test_a_kite_that_starts_turned_meets_the_wind_of_where_it_is(tmp_path):
    """start_azimuth turns the kite about its pivot; wind and ground turned with it make the same loads."""
    folder = copy_of("v3_kite", tmp_path)
    append(folder, "[aero.linear_wind]\nground = [-40.0, 0.0, -60.0]\n")
    scene = scenes.load(folder)
    about = scene.members.nodes[scene.pivot]
    found = []
    for angle in (0.0, 0.9):
        core, turn = scene.aero_core(), azimuth_axes(angle)
        core.set("start_azimuth", angle)
        core.set("wind_direction", turn[:, 0])
        core.set("ground_point", turn @ (np.array([-40.0, 0.0, -60.0]) - about) + about)
        core.set("kite_point", turn @ (core.get("kite_point") - about) + about)
        core.look()
        assert bool(core.get("symmetry_used"))
        found.append(core)
    for name in ("CL", "CD", "alpha_mid", "glide_ratio"):
        assert float(found[1].get(name)) == pytest.approx(float(found[0].get(name)), rel=1e-9)
    assert found[1].get("line_force") == pytest.approx(turn @ found[0].get("line_force"), abs=1e-7)


def test_a_gradient_across_the_plane_of_symmetry_turns_symmetry_off(tmp_path):
    (tmp_path / "a").mkdir()
    assert bool(wing(tmp_path / "a", "symmetric = true\n" + GROUND).get("symmetry_used"))
    core = wing(tmp_path, "symmetric = true\n" + GROUND + TURN)
    assert not bool(core.get("symmetry_used"))
    assert abs(core.get("moment")[0]) > 1.0  # N m


def test_parameters_change_it_from_step_to_step(tmp_path):
    core = wing(tmp_path, GROUND)
    before = float(core.get("CL"))
    core.set("ground_wind_share", 1.0)
    core.step(0.0, 1.0)
    assert not core.get("wind_gradient").any()
    assert float(core.get("CL")) != before
    core.set("ground_wind_share", 0.0)
    core.step(1.0, 1.0)
    assert float(core.get("CL")) == pytest.approx(before, rel=1e-9)  # from a warm start


def test_lengths_at_a_scale_are_scaled(tmp_path):
    setting = "[settings.scale]\ndefault = 1.0\nminimum = 0.1\n\n[wing]"
    folder = flat_wing(tmp_path, aero=GROUND + "kite = [0.0, 0.0, 10.0]\n" + TURN)
    edited(folder, "scene.toml", "[wing]", setting)
    aero = scenes.load(folder, {"scale": 0.5}).aero
    assert aero.linear_wind.ground == (-15.0, 0.0, -50.0)
    assert aero.linear_wind.kite == (0.0, 0.0, 5.0)
    assert aero.rotation.centre == (0.0, 2.5, -10.0)
    assert aero.rotation.rate == (0.1, 0.2, -0.3)  # not a length


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ("[aero.linear_wind]\n", r"\[aero.linear_wind\] lacks 'ground'; add it\."),
        ("[aero.linear_wind]\nground = [0, 0]\n", r"\[aero.linear_wind\] ground must be three finite numbers; it is"),
        (GROUND + "share = 0.1\n", r"\[aero.linear_wind\] has an unknown key 'share'; known are: ground, kite, ground"),
        (GROUND + "ground_share = -0.1\n", r"ground_share must be a number from 0 to 10; it is '-0.1'"),
        ("linear_wind = 3\n", r"\[aero\] linear_wind must be a table; it is '3'"),
        ("[aero.linear_wind]\nground = [0, 0, 0]\n", r"kite is not given, so that it is the origin, at the same place"),
        (GROUND + "kite = [-30, 0, -100]\n", r"kite is at the same place as ground, .*; move one of them\."),
        ("[aero.rotation]\nrate = 3\n", r"\[aero.rotation\] rate must be three finite numbers; it is '3'"),
    ],
)
def test_what_is_wrong_is_told_in_one_sentence(tmp_path, table, sentence):
    with pytest.raises(SceneError, match=rf"^flat_wing/scene.toml: .*{sentence}"):
        scenes.load(flat_wing(tmp_path, aero=table))


def test_a_line_without_length_ends_the_step_and_can_be_mended(tmp_path):
    core = wing(tmp_path, GROUND)
    core.set("ground_point", core.get("kite_point"))
    with pytest.raises(StepFailed, match=r"^ground_point and kite_point are one point, .*; move one of them\.$"):
        core.step(0.0, 1.0)
    core.set("ground_point", [0.0, 0.0, -50.0])
    core.step(0.0, 1.0)


def test_exchanged_pressure_over_the_wind_of_the_place_is_the_reported_coefficient(tmp_path):
    core = wing(tmp_path, GROUND + TURN)
    scene = scenes.load(tmp_path / "flat_wing")
    blocks = {v.name: core.get(v.name) for v in core.variables}
    loads = panel_loads(scene.interface.nodes, scene.interface.panels, blocks)
    middle = scene.interface.nodes[scene.interface.panels].mean(axis=1)
    wind = np.array([10.0, 0.0, 0.0]) * (1.0 + middle @ [30.0, 0.0, 100.0] / (30.0**2 + 100.0**2))[:, None]
    wind = wind - np.cross([0.1, 0.2, -0.3], middle - [0.0, 5.0, -20.0])
    assert loads.dynamic_pressure == pytest.approx(0.5 * 1.225 * (wind**2).sum(axis=1), rel=1e-12)
