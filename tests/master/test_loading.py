"""Span loading of closed bodies in the results of a run: table, plot and page."""

import csv

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from master.report.loading import span_loading
from master.report.loading_plot import loading_figure

SKETCH = {"variant": "sketch"}


@pytest.fixture(scope="module", params=["box_wing", "swept_wing"])
def looked(request):
    scene = scenes.load(request.param, SKETCH)
    core = scene.aero_core()
    core.look()
    return scene, {v.name: core.get(v.name) for v in core.variables}


def surfaces(scene, blocks):
    return span_loading(scene.wing_model.edge_strips, scene.interface.nodes, blocks)


def test_the_table_has_the_lift_of_the_wing(looked):
    scene, blocks = looked
    found = surfaces(scene, blocks)
    lift = sum(s.width @ s.lift for s in found)
    assert lift == pytest.approx(float(blocks["trefftz_lift"]), rel=1e-12)
    # c c_l is the force across the wind over the dynamic pressure, whichever way it points
    q = 0.5 * float(blocks["air_density"]) * float(blocks["wind_speed"]) ** 2
    for s in found:
        assert np.abs(s.loading) == pytest.approx(np.hypot(s.lift, s.side) / q, rel=1e-9)
        assert s.arc == pytest.approx(-s.arc[::-1], abs=1e-9)


def test_the_plot_shows_all_of_every_surface(looked):
    scene, blocks = looked
    found = surfaces(scene, blocks)
    figure = loading_figure(found, "a scene")
    assert len(figure.axes) == 3 * len({s.upright for s in found})
    values = [line.get_ydata() for panel in figure.axes for line in panel.get_lines()]
    for s in found:
        for shown in (s.loading, s.by_pressure, s.loading / s.chord, s.by_pressure / s.chord, np.rad2deg(s.alpha)):
            assert any(np.array_equal(v, shown) for v in values), s.name


def test_a_run_leaves_strips_and_their_plot(tmp_path):
    out = tmp_path / "out"
    arguments = ["run", "box_wing", "--set", "variant=sketch", "--backend", "in-process", "--out", str(out)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    with (out / "strips.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["surface"] for row in rows][:: len(rows) - 1] == ["upper wing", "right end plate"]
    assert sorted(int(row["strip"]) for row in rows) == list(range(1, len(rows) + 1))
    total = sum(float(row["width_m"]) * float(row["lift_N_per_m"]) for row in rows)
    by_pressure = sum(float(row["width_m"]) * float(row["pressure_lift_N_per_m"]) for row in rows)
    scene = scenes.load("box_wing", SKETCH)
    core = scene.aero_core()
    core.look()
    assert total == pytest.approx(float(core.get("trefftz_lift")), rel=1e-12)
    assert by_pressure == pytest.approx(float(core.get("pressure_lift")), rel=1e-12)
    assert (out / "loading.png").stat().st_size > 10_000
    assert "Strips of the surfaces" in (out / "report.html").read_text(encoding="utf-8")


def test_without_values_there_is_no_loading(looked):
    scene, blocks = looked
    spoiled = blocks | {"span_loading": np.full_like(blocks["span_loading"], np.nan)}
    assert surfaces(scene, spoiled) == ()
    assert span_loading(None, scene.interface.nodes, blocks) == ()
