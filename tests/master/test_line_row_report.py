"""Lines of a parafoil by row and rib in what a run leaves: tensions, shares, their sums."""

import csv
import json
import re
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from master.report.line_rows import line_row_figure, line_row_results, line_row_rows, line_rows

ROWS, RIBS = ("A", "B", "C", "D"), 11


def numbered(members):
    """A tension N of every element that tells row and rib: 100 for A to 400 for D and the number of the rib."""
    at = {f"{row}_{rib}": 100.0 * (r + 1) + rib for r, row in enumerate(ROWS) for rib in range(1, RIBS + 1)}
    return np.array([at.get(name, 1e6) for name in members.names])


def edited(tmp_path, more):
    """Members of the small parafoil with more keys of [bridle]."""
    folder = tmp_path / "kite"
    shutil.copytree(scenes.load("parafoil_small").folder, folder)
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(re.sub(r"^depth =", f"{more}\ndepth =", text, count=1, flags=re.MULTILINE))
    return scenes.load(folder).members


def test_every_line_stands_at_its_row_and_rib():
    members = scenes.load("parafoil_small").members
    found = line_rows(members, numbered(members))
    assert found.rows == ROWS
    assert found.ribs.tolist() == list(range(1, RIBS + 1))
    assert np.array_equal(found.tension, found.ribs[:, None] + 100.0 * np.arange(1, 5))
    assert found.ribs[found.middle] == 6
    assert found.arc == pytest.approx(-found.arc[::-1], abs=1e-12)  # m, drawn alike on both sides but for rounding
    assert found.arc[found.middle] == pytest.approx(0.0, abs=1e-12)


def test_shares_of_a_rib_add_up_to_all_of_it_and_are_undefined_without_tension():
    members = scenes.load("parafoil_small").members
    tension = numbered(members)
    tension[[name.endswith("_3") for name in members.names]] = 0.0
    share = line_rows(members, tension).share
    assert np.isnan(share[2]).all()
    assert np.delete(share, 2, axis=0).sum(axis=1) == pytest.approx(np.ones(RIBS - 1), rel=1e-14)  # rounding
    assert share[5] == pytest.approx(np.array([106.0, 206.0, 306.0, 406.0]) / 1024.0, rel=1e-14)


@pytest.mark.parametrize(
    "more",
    [
        "cascade = 2\ncascade_share = 0.6",
        "belt_ribs = 1\nbelt_diameter = 0.004",
        "tether_length = 100.0\ntether_diameter = 0.014",
    ],
)
def test_lines_below_those_on_the_ribs_belong_to_no_row(tmp_path, more):
    members = edited(tmp_path, more)
    found = line_rows(members, numbered(members))
    assert len(members.names) > len(ROWS) * RIBS
    assert found.rows == ROWS
    assert np.array_equal(found.tension, found.ribs[:, None] + 100.0 * np.arange(1, 5))


@pytest.mark.parametrize("name", ["v3_kite", "hencky", "flexible_wing"])
def test_other_scenes_have_no_rows(name):
    members = scenes.load(name).members
    assert line_rows(members, np.zeros(len(members.names))) is None
    assert line_row_results(members, np.zeros(len(members.names))) is None
    assert line_row_rows(members, np.zeros(len(members.names))) == []


def test_the_figure_has_a_curve_a_row_over_all_ribs():
    members = scenes.load("parafoil_small").members
    found = line_rows(members, numbered(members))
    above, below = line_row_figure(found, "A kite").axes
    for panel, values in ((above, found.tension), (below, 100.0 * found.share)):
        assert [line.get_label() for line in panel.lines] == [f"row {row}" for row in ROWS]
        assert all(np.array_equal(line.get_ydata(), values[:, r]) for r, line in enumerate(panel.lines))


def test_lines_of_a_flown_parafoil_carry_its_pull_to_the_pilot_point(tmp_path):
    words = ["run", "parafoil_small", "--backend", "in-process", "--no-stability", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, words, env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output

    def table(name):
        with (tmp_path / name).open() as file:
            return list(csv.DictReader(file))

    lines, content = table("rib_lines.csv"), json.loads((tmp_path / "summary.json").read_text())
    nodes = {row["node"]: np.array([float(row[f"{a}_m"]) for a in "xyz"]) for row in table("nodes.csv")}
    tension = {row["element"]: row["tension_N"] for row in table("elements.csv")}
    pull, own = np.zeros(3), np.asarray(content["outputs"]["line_force"])
    for line in lines:
        assert line["tension_N"] == tension[line["element"]]
        way = nodes[line["element"]] - nodes["pilot"]
        pull += float(line["tension_N"]) * way / np.linalg.norm(way)
    # the other half of the wind on the lines goes to the pilot point itself; residual 1e-3 N or less on all nodes
    assert pull + 0.5 * own == pytest.approx(content["outputs"]["support_force"], abs=1e-2)
    rows, middle = content["line_rows"]["row_tension_N"], content["line_rows"]["at_middle_rib"]
    for name in ROWS:
        assert rows[name] == pytest.approx(sum(float(line["tension_N"]) for line in lines if line["row"] == name))
        assert middle[name]["tension_N"] == float(tension[f"{name}_6"])
    assert "lines at rib 6 of 11" in done.output
    assert f"B {middle['B']['tension_N']:.4g} N ({100.0 * middle['B']['share']:.1f} %)" in done.output
    assert (tmp_path / "rib_lines.svg").stat().st_size > 10_000
