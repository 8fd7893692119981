"""Ribs and cells of a ram-air wing in what a run leaves: profiles, pressure, stress across the span."""

import csv
import shutil
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from master.report.panels import panel_loads
from master.report.ribs import _heights, _middle, arc_radius, rib_figure, ribs, shown


@pytest.fixture(scope="module")
def sketch():
    """The scene flexible_wing, sketch, with the blocks of its structure before any load."""
    scene = scenes.load("flexible_wing", {"variant": "sketch"})
    core = scene.cores()["structural"]
    return scene, {name: core.get(name) for name in core.names}


def found(sketch, C_p=None, **blocks):
    scene, at_rest = sketch
    nodes, panels = scene.interface.nodes, scene.interface.panels
    flow = {"wind_speed": np.array(10.0), "wind_direction": np.array([1.0, 0.0, 0.0]), "air_density": np.array(1.2)}
    flow |= {"pressure": np.full(len(panels), 60.0)}
    flow |= {} if C_p is None else {"pressure_coefficient": C_p}
    loads = panel_loads(nodes, panels, flow)
    return ribs(scene.members, at_rest | blocks, scene.interface, nodes, loads)


def table(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def naca0018(x):
    """Half of the thickness of the NACA 0018 with a closed trailing edge."""
    return 0.9 * (0.2969 * np.sqrt(x) - 0.1260 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)


def test_every_rib_of_the_wing_is_found_with_a_cell_to_the_next(sketch):
    of = found(sketch)
    assert [rib.name for rib, _ in of] == [f"rib_{k}" for k in range(1, 6)]
    assert [cell is None for _, cell in of] == [False] * 4 + [True]
    assert [rib.arc for rib, _ in of] == pytest.approx([-1.0, -0.5, 0.0, 0.5, 1.0])
    assert shown(of) == [2, 3]  # 0.5 m is nearest to 70 % of the way to the tip


def test_a_rib_at_rest_has_the_profile_that_it_is_cut_to(sketch):
    for rib, _ in found(sketch):
        assert np.array_equal(rib.shape, rib.design)
        x, z = rib.shape.T
        side = np.where(np.arange(len(x)) <= len(x) // 2, 1.0, -1.0)
        assert z == pytest.approx(side * naca0018(np.abs(x)), abs=1e-9)
        assert rib.thickness[0] == pytest.approx(0.18, rel=0.01)  # nodes need not stand where it is thickest


def test_pressure_beside_a_rib_is_the_mean_of_the_panels_that_touch_it(sketch):
    scene, _ = sketch
    panels = scene.interface.panels
    value = np.arange(float(len(panels)))
    for rib, _ in found(sketch, value):
        for k, ends in enumerate(zip(rib.nodes, np.roll(rib.nodes, -1), strict=True)):
            beside = [i for i, panel in enumerate(panels) if set(ends) <= set(panel)]
            assert rib.C_p[k] == pytest.approx(value[beside].mean())


def test_a_stress_along_the_span_is_found_whole_and_one_along_the_chord_not_at_all(sketch):
    scene, _ = sketch
    e = len(scene.members.membranes.group.names)
    for direction, wanted in (([0.0, 1.0, 0.0], 7.0), ([1.0, 0.0, 0.0], 2.0)):
        blocks = {"membrane_cauchy_stress_1": np.full(e, 7.0), "membrane_cauchy_stress_2": np.full(e, 2.0)}
        blocks["wrinkle_direction"] = np.broadcast_to(direction, (e, 3))
        (_, cell), *_ = found(sketch, **blocks)
        aft = np.abs(found(sketch)[0][0].place) > 0.5  # where the skin runs along the chord within 12 degrees
        assert cell.stress[aft] == pytest.approx(np.full(aft.sum(), wanted), rel=0.02 if direction[1] else 0.1)


def test_barlow_has_the_pressure_times_the_radius_of_the_arc(sketch):
    rib, cell = found(sketch)[0]
    heights = 2.0 * naca0018(np.abs(rib.design[:, 0]))
    radius = arc_radius(np.full(len(heights), 0.5), 0.5 * (heights + np.roll(heights, -1)))
    assert cell.barlow == pytest.approx(60.0 * radius, rel=1e-9)


def test_the_cells_of_a_parafoil_with_sewn_tips_lie_between_their_own_ribs():
    """Round sewn tips the rows of quads go on over the other side: the way over the whole wing is no cell."""
    scene = scenes.load("parafoil_small")
    core = scene.cores()["structural"]
    of = found((scene, {name: core.get(name) for name in core.names}))
    nodes = scene.interface.nodes
    for (rib, cell), (other, _) in pairwise(of):
        width = np.linalg.norm(nodes[other.nodes] - nodes[rib.nodes], axis=1)
        height = 0.5 * (_heights(nodes[rib.nodes]) + _heights(nodes[other.nodes]))
        radius = arc_radius(_middle(width), _middle(height))
        # ribs are joined by straight strips as drawn, so that the cloth of a cell is as wide as they are apart
        assert cell.barlow == pytest.approx(60.0 * radius, rel=1e-9)


def test_barlow_takes_the_width_to_which_a_panel_is_cut(tmp_path):
    """Narrower cloth has a smaller radius, where it is cut so: here by nothing at the nose and 8 % at the tail."""
    folder = shutil.copytree(scenes.load("parafoil_small").folder, tmp_path / "kite")
    text = (folder / "scene.toml").read_text()
    cut = 'shape = "body"\npanel_shortening = [[0.0, 0.0], [1.0, 8.0]]'
    (folder / "scene.toml").write_text(text.replace('shape = "body"', cut))
    scene = scenes.load(folder)
    core = scene.cores()["structural"]
    of = found((scene, {name: core.get(name) for name in core.names}))
    (rib, cell), (other, _) = of[5], of[6]
    nodes = scene.interface.nodes
    width = _middle(np.linalg.norm(nodes[other.nodes] - nodes[rib.nodes], axis=1))
    height = _middle(0.5 * (_heights(nodes[rib.nodes]) + _heights(nodes[other.nodes])))
    share = [0.5 * (r.design[:, 0] + np.roll(r.design[:, 0], -1)) for r in (rib, other)]
    # strips are even in width: the shares of the chord at both ribs, in chords of each, are alike on this profile
    chord = np.ptp(rib.design[:, 0]), np.ptp(other.design[:, 0])
    assert share[0] / chord[0] == pytest.approx(share[1] / chord[1], abs=1e-12)
    radius = arc_radius((1.0 - 0.08 * share[0] / chord[0]) * width, height)
    # sides of a tapered cell lean by up to 0.008 rad from the direction in which it is narrower
    assert cell.barlow == pytest.approx(60.0 * radius, rel=1e-4)
    assert cell.barlow[0] < 0.95 * 60.0 * arc_radius(width, height)[0]


@pytest.mark.parametrize("half", [0.3, 1.0, 1.5, 0.5 * np.pi])
def test_an_arc_around_a_point_halfway_up_the_rib_has_the_radius_of_its_angle(half):
    radius = 0.7
    height = 2.0 * radius * np.cos(half)
    assert arc_radius(np.array(2.0 * half * radius), np.array(height)) == pytest.approx(radius, rel=1e-12)


def test_a_mesh_that_is_no_skin_has_no_ribs(sketch):
    scene = scenes.load("airbag", {"cells": 2})
    core = scene.cores()["structural"]
    blocks = {name: core.get(name) for name in core.names}
    assert ribs(scene.members, blocks, scene.interface, scene.interface.nodes, SimpleNamespace()) == []


def test_a_run_writes_the_table_and_draws_the_figure(tmp_path):
    words = ["run", "flexible_wing", "--set", "variant=sketch", "--backend", "in-process", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "ribs.svg").stat().st_size > 10_000
    rows, panels = table(tmp_path / "ribs.csv"), table(tmp_path / "panels.csv")
    assert len(rows) == 5 * 32
    first = rows[0]
    ends = {first["node_1"], first["node_2"]}
    beside = [p for p in panels if ends <= {p[f"node_{k}"] for k in range(1, 5)}]
    assert float(first["C_p"]) == pytest.approx(np.mean([float(p["C_p"]) for p in beside]))


def test_the_figure_names_ribs_and_thickness(sketch):
    text = [t.get_text() for axes in rib_figure(found(sketch), "A wing").axes for t in axes.texts]
    assert any("thickness 18" in t or "thickness 17.9" in t for t in text)
