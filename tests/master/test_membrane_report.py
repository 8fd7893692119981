"""What a run of a scene with membranes leaves: rows, tables, VTK files, plot and page."""

import csv
import json

import meshio
import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from master.report.membranes import FIELDS, membrane_figure, membrane_state
from tests.scenes.membrane_scenes import ISOTROPIC, held, rectangle, solved, written


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """The folder of a run of the airbag with 64 triangles, and what it printed."""
    out = tmp_path_factory.mktemp("bag")
    words = ["run", "airbag", "--backend", "in-process", "--set", "cells=4", "--out", str(out)]
    done = CliRunner().invoke(app, words, env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output
    return out, done.output


def table(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_the_printed_table_says_how_the_membranes_are(bag):
    for row in (
        "membranes", "largest membrane stress", "largest membrane strain", "enclosed volume", "force on support groups",
        "largest seam forces", "under inner_pressure", "% of the area wrinkled", "symmetry_x (",
    ):  # fmt: skip
        assert row in bag[1]


def test_every_triangle_has_its_row_with_stress_state_and_direction(bag):
    rows = table(bag[0] / "membranes.csv")
    core = solved("airbag", {"cells": 4})
    assert [row["element"] for row in rows] == list(core.solver.model.members.membranes.group.names)
    of = {"stress_1_N_per_m": "membrane_stress_1", "cauchy_stress_2_N_per_m": "membrane_cauchy_stress_2"}
    for column, block in (of | {"strain": "membrane_strain", "state": "wrinkle_state"}).items():
        values = np.array([float(row[column]) for row in rows])
        assert values == pytest.approx(core.get(block), rel=1e-6, abs=1e-6)  # a solve more, to the same tolerance
    area = sum(float(row["area_m2"]) for row in rows)
    assert area == pytest.approx(0.422**2)
    direction = np.array([[float(row[f"direction_{axis}"]) for axis in "xyz"] for row in rows])
    assert np.linalg.norm(direction, axis=1) == pytest.approx(np.ones(64))
    places = {row["node"] for row in table(bag[0] / "nodes.csv")}
    assert {row[f"node_{k}"] for row in rows for k in (1, 2, 3)} == places


def test_sides_of_seams_have_their_force_and_the_summary_the_largest(bag):
    rows, content = table(bag[0] / "seams.csv"), json.loads((bag[0] / "summary.json").read_text())
    found = content["membranes"]
    assert {row["seam"] for row in rows} == {"seam", "symmetry_x", "symmetry_y"}
    force = {name: [] for name in found["largest_seam_force_N_per_m"]}
    for row in rows:
        force[row["seam"]].append([float(row[f"force_{axis}_N_per_m"]) for axis in "xyz"])
    for name, most in found["largest_seam_force_N_per_m"].items():
        assert np.linalg.norm(force[name], axis=1).max() == pytest.approx(most, rel=1e-12)
    total = np.sum(list(found["support_force_N"].values()), axis=0)
    assert total == pytest.approx(content["outputs"]["support_force"], rel=1e-6)
    assert found["volume_m3"]["inner_pressure"] == content["outputs"]["inner_pressure_volume"]
    # a force per length of the cut over its length of 0.422 m is what the plane x = 0 bears, as constant strains go
    pull = np.mean(force["symmetry_x"], axis=0) * 0.422
    assert abs(pull[0]) == pytest.approx(found["support_force_N"]["symmetry_x"][0], rel=0.02)


@pytest.mark.parametrize("order", [1, 2])
def test_vtk_has_the_fields_of_the_table_and_leads_back_to_the_start_shape(tmp_path, order):
    words = ["run", "airbag", "--backend", "in-process", "--set", "cells=2", "--set", f"order={order}"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    mesh, members = meshio.read(tmp_path / "membranes.vtu"), scenes.load("airbag", {"cells": 2, "order": order}).members
    (cells,) = mesh.cells
    assert cells.type == ("triangle" if order == 1 else "triangle6")
    assert np.array_equal(cells.data, members.membranes.group.nodes)
    assert {*FIELDS, "fabric", "element"} == set(mesh.cell_data)
    assert mesh.points - mesh.point_data["displacement_m"] == pytest.approx(members.nodes, abs=1e-12)


def test_the_plot_shades_every_triangle_and_strokes_the_wrinkled_ones():
    core = solved("airbag", {"cells": 4})
    found = membrane_state(core.solver.model.members, {name: core.get(name) for name in core.names})
    left, right, *_ = membrane_figure(found, "bag").axes
    wrinkled = int(np.count_nonzero(found.state == 1))
    assert len(left.collections[0].get_paths()) == 64
    assert len(right.collections[0].get_paths()) == 64 + wrinkled
    assert 0 < wrinkled < 64


def test_the_page_has_tables_of_fabrics_supports_and_seams_and_the_plot(bag):
    page = (bag[0] / "report.html").read_text()
    for words in (
        "Membranes (principal Cauchy stress",
        "Forces on groups of supports",
        "Forces of seams",
        "membranes.svg",
    ):
        assert words in page
    for kind in ("png", "svg"):
        assert (bag[0] / f"membranes.{kind}").stat().st_size > 1000


def test_cables_and_strength_are_shown_beside_the_membranes(tmp_path):
    more = held("x_min", "x_max", "y_max") + "[membranes.cables.y_min]\naxial_stiffness = 1e4\nshortening = 0.5\n"
    more += "[membranes.pressures.inside]\nvalue = 50.0\n"
    path = written(tmp_path, rectangle(fabric=ISOTROPIC + "strength = 1e4\n", more=more))
    words = ["run", str(path), "--backend", "in-process", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, words, env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output
    assert "of the strength in membrane_" in done.output
    assert "largest line tension" in done.output
    assert [row["element"] for row in table(tmp_path / "out" / "elements.csv")] == [f"y_min_{k}" for k in (1, 2, 3, 4)]
    assert "enclosed volume" not in done.output  # an open edge, held in no plane
