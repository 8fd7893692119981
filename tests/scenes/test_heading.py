"""A kite in a wind from another side is the same kite, turned about the upright axis through its bridle point."""

import csv

import numpy as np
import pytest

import scenes
from aero.wind import coefficients
from benchmarks.problems import as_fmus
from interface import StepFailed, UprightPlane
from interface.vectors import azimuth, azimuth_axes
from master import IQNILS
from master.commands import run_scene
from master.coupling import Coupling, solve

from .broken import copy_of

# Both residuals far below what is compared: 1e-5 N over some 1000 N of load, 1e-9 m over some metres.
TIGHT = {"atol": 1e-9, "force_tolerance": 1e-5}
SAME = ("CL", "CD", "CS", "alpha_mid", "span", "tip_span", "glide_ratio")


def towards(degrees):
    """A level wind direction (3,) that is turned by `degrees` from x."""
    return tuple(azimuth_axes(np.deg2rad(degrees))[:, 0].tolist())


def flown(scene, degrees, **parameters):
    coupling = Coupling.in_process(scene, {"wind_direction": towards(degrees), **parameters})
    return coupling, solve(coupling, IQNILS(), **TIGHT)


@pytest.fixture(scope="module", params=["v3_kite", "v3_kite_detailed"])
def unturned(request):
    scene = scenes.load(request.param)
    return scene, *flown(scene, 0.0)


def assert_same_kite(one, other, degrees):
    """All that does not depend on the side that the wind comes from is equal, and all else is turned."""
    a, b = one.structural.get("tension"), other.structural.get("tension")
    assert np.abs(a - b).max() <= 1e-6 * a.max()
    for name in SAME:
        assert float(other.aero.get(name)) == pytest.approx(float(one.aero.get(name)), rel=1e-6, abs=1e-9)
    axes = azimuth_axes(np.deg2rad(degrees))
    for side, name in (("aero", "force"), ("aero", "moment"), ("aero", "line_force"), ("structural", "support_force")):
        turned = getattr(one, side).get(name) @ axes.T
        assert np.abs(getattr(other, side).get(name) - turned).max() <= 1e-6 * np.linalg.norm(turned)
    here, there = one.structural.get("position") @ axes.T, other.structural.get("position")
    assert np.abs(here - there).max() <= 1e-6  # m


@pytest.mark.parametrize("degrees", [11.0, 90.0, 200.0])
def test_the_kite_flies_alike_whatever_side_the_wind_comes_from(unturned, degrees):
    scene, one, first = unturned
    other, result = flown(scene, degrees)
    assert result.status == "converged"
    assert result.residual_N <= 1e-5
    assert abs(result.iterations - first.iterations) <= 1
    assert other.structural.get("symmetry_used")
    assert other.aero.get("symmetry_used")
    assert_same_kite(one, other, degrees)


def turned_copy(name, folder, degrees):
    """A copy of a scene whose tables and wind are turned by `degrees` about z."""
    scene, axes = copy_of(name, folder), azimuth_axes(np.deg2rad(degrees))
    for table, points in (("nodes.csv", ("{}_m",)), ("sections.csv", ("le_{}_m", "te_{}_m"))):
        with open(scene / table, encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        for row in rows:
            for point in points:
                columns = [point.format(axis) for axis in "xyz"]
                row.update(zip(columns, (repr(float(v)) for v in axes @ [float(row[c]) for c in columns]), strict=True))
        with open(scene / table, "w", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
    wind = ", ".join(repr(float(v)) for v in towards(degrees))
    text = (scene / "scene.toml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("wind_direction")]
    (scene / "scene.toml").write_text("\n".join(lines).replace("[aero]", f"[aero]\nwind_direction = [{wind}]"))
    return scenes.load(scene)


def test_springs_measured_between_turned_points_are_mirror_images_of_one_another(tmp_path):
    """Of an inflatable wing, whose rest lengths follow from its nodes: half of it is solved however it is drawn."""
    folder = turned_copy("v3_kite_detailed", tmp_path, 37.0).folder
    core = scenes.load(folder, {"canopy_stations": 2}).structural_core()
    core.step(0.0, 1.0)  # in still air, under its weight
    assert core.get("symmetry_used")


def test_a_pivot_beside_the_plane_of_symmetry_stays_beside_it_in_a_turned_kite(tmp_path):
    folder = turned_copy("v3_kite", tmp_path, 30.0).folder
    text = (folder / "scene.toml").read_text().replace("pivot = 0", "pivot = 1")
    (folder / "scene.toml").write_text(text)
    drawn = scenes.load("v3_kite").interface.nodes
    turned = scenes.load(folder)
    assert np.abs(turned.heading.home(turned.interface.nodes)[:, 1] - drawn[:, 1]).max() <= 1e-12


@pytest.mark.parametrize(("wind", "says"), [((0.0, 0.0, 2.0), "straight up"), ((0.0, 0.0, -1.0), "straight down")])
def test_an_upright_wind_is_refused_for_what_it_is(wind, says):
    with pytest.raises(scenes.SceneError, match=says):
        scenes.load("v3_kite").with_trim({"wind_direction": wind})


def test_wind_along_the_span_of_a_kite_is_refused_where_it_does_not_turn():
    core = scenes.load("v3_kite").aero_core()
    core.set("wind_direction", (0.0, 1.0, 0.0))
    with pytest.raises(StepFailed, match=r"along the span of the wing; turn the kite to it \(start_azimuth\)"):
        core.step(0.0, 1.0)


@pytest.mark.parametrize("degrees", [20.0, 160.0])
def test_a_kite_that_is_drawn_turned_flies_alike_too(tmp_path, degrees):
    drawn, turned = scenes.load("v3_kite"), turned_copy("v3_kite", tmp_path, degrees)
    assert turned.trim_angle() == pytest.approx(drawn.trim_angle(), abs=2e-6)  # the search ends at 1e-6 rad
    one, first = flown(drawn, 0.0)
    other, result = flown(turned, degrees)
    assert result.status == "converged"
    assert abs(result.iterations - first.iterations) <= 1
    assert other.structural.get("symmetry_used")
    assert_same_kite(one, other, degrees)
    # and in a third wind: the start turns by the difference
    again, _ = flown(turned, 90.0)
    assert_same_kite(one, again, 90.0)


def test_fmus_of_a_kite_in_wind_from_the_side_are_the_same_kite():
    coupling = Coupling.in_process(scenes.load("v3_kite"))
    solve(coupling, IQNILS(), **TIGHT)
    with as_fmus("v3_kite", wind_direction=towards(70.0)) as other:
        assert solve(other, IQNILS(), **TIGHT).status == "converged"
        assert_same_kite(coupling, other, 70.0)


def test_a_transient_kite_moves_alike_whatever_side_the_wind_comes_from():
    scene, found = scenes.load("v3_kite_dynamic"), []
    for degrees in (0.0, 130.0):
        given = scene.with_trim({"wind_direction": towards(degrees), "start_in_equilibrium": 0.0})
        cores = scene.cores()
        for core in cores.values():
            for name in given.keys() & set(core.names):
                core.set(name, given[name])
        for step in range(5):
            cores["aero"].set("displacement", cores["structural"].get("displacement"))
            cores["aero"].set("velocity", cores["structural"].get("velocity"))
            cores["aero"].step(0.02 * step, 0.02)
            for load in scene.loads:
                cores["structural"].set(load, cores["aero"].get(load))
            cores["structural"].step(0.02 * step, 0.02)
        axes = azimuth_axes(np.deg2rad(degrees))
        blocks = {name: cores["structural"].get(name) @ axes for name in ("position", "velocity", "support_force")}
        found.append(blocks | {"tension": cores["structural"].get("tension")})
    for name, value in found[0].items():
        assert np.abs(found[1][name] - value).max() <= 1e-9 * np.abs(value).max(), name


def test_derivatives_turn_with_the_kite():
    scene, rng = scenes.load("v3_kite"), np.random.default_rng(1)
    change = rng.standard_normal(scene.interface.nodes.shape)
    found = []
    for degrees in (0.0, 75.0):
        axes = azimuth_axes(np.deg2rad(degrees))
        coupling, _ = flown(scene, degrees)
        loads = coupling.aero.directional_derivative({"displacement": change @ axes.T})
        moved = coupling.structural.directional_derivative(loads)["displacement"]
        found.append([loads["pressure"], *(v @ axes for v in (loads["shear"], loads["line_load"], moved))])
    for one, other in zip(*found, strict=True):
        # slopes of polars change between points of their tables, where the two equilibria differ by 1e-9 m
        assert np.abs(one - other).max() <= 1e-6 * np.abs(one).max()


def test_stability_is_judged_alike_whatever_side_the_wind_comes_from(tmp_path):
    from master.coupling import static_stability

    found = []
    for degrees in (0.0, 100.0):
        coupling, result = flown(scenes.load("v3_kite"), degrees)
        found.append(static_stability(coupling, result.displacement))
    assert found[1].statically_stable is found[0].statically_stable is True
    assert found[1].symmetric_only is found[0].symmetric_only is True
    assert found[1].eigenvalue == pytest.approx(found[0].eigenvalue, rel=1e-3)  # what the search is stopped at


def test_a_kite_on_two_supports_does_not_turn(tmp_path):
    folder = copy_of("v3_kite", tmp_path)
    with open(folder / "nodes.csv", "a", encoding="utf-8") as file:
        file.write("anchor,0.0,30.0,0.0,xyz\n")
    given = scenes.load(folder).with_trim({"wind_direction": towards(5.0), "trim_angle": 0.2})
    assert "start_azimuth" not in given


def test_an_angle_of_trim_that_is_not_found_for_a_wind_from_the_side_says_so(tmp_path, capsys):
    with pytest.raises(ValueError, match=r"turn the kite to the wind, which comes 60 degrees from the side"):
        run_scene(
            "v3_kite", {"scheme": "iqn-ils", "backend": "in-process", "order": "serial", "tolerance": 1e-5,
            "force_tolerance": 0.01, "max_iterations": 10, "relaxation": None, "stability": False, "report": False},
            {"wind_direction": "0.5,0.8660254,0", "start_azimuth": "0"}, tmp_path / "out",
        )  # fmt: skip


@pytest.mark.parametrize("degrees", [0.0, 50.0, 180.0, 300.0])
@pytest.mark.parametrize("climb", [-0.4, 0.0, 0.7])
def test_lift_is_up_and_across_the_wind_from_every_side(degrees, climb):
    wind = np.array([*(np.cos(climb) * np.array(towards(degrees)[:2])), np.sin(climb)])
    found = coefficients(np.array([0.0, 0.0, 2.0]), wind, 4.0)
    expected = 0.5 * np.cos(climb), 0.5 * np.sin(climb), 0.0
    assert pytest.approx(expected, abs=1e-15) == (found.CL, found.CD, found.CS)
    aside = coefficients(azimuth_axes(np.deg2rad(degrees))[:, 1], wind, 4.0)
    assert pytest.approx((0.0, 0.0, 0.25), abs=1e-15) == (aside.CL, aside.CD, aside.CS)


def test_an_upright_plane_mirrors_what_is_symmetric_in_it():
    rng, axes = np.random.default_rng(0), azimuth_axes(0.8)
    right = rng.standard_normal((6, 3)) + np.array([0.0, 4.0, 0.0])
    left = right * [1.0, -1.0, 1.0]
    one, other = ((points + np.array([0.0, 0.5, 0.0])) @ axes.T for points in (left, right))
    plane = UprightPlane.between(one, other)
    a, b = plane.inward(one, point=True), plane.inward(other, point=True)
    assert np.abs(a - b * [1.0, -1.0, 1.0]).max() <= 1e-14
    assert plane.outward(plane.inward(one)) == pytest.approx(one, abs=1e-14)
    exact = UprightPlane.between(left, right)
    assert exact.inward(left, point=True) is left
    assert UprightPlane.between(np.zeros((2, 3)), np.array([[0.0, 0.0, 1.0]])) is None
    assert azimuth(axes[:, 0]) == pytest.approx(0.8, abs=1e-15)
