"""A scene without wing and wind, whose interface has no node: the same motion as FMU and in-process, and results."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from master import compare
from master.cli import app
from master.commands import opened
from master.coupling import simulate
from scenes import load
from tests.master.lone import lone_scene


@pytest.fixture(scope="module")
def lone(tmp_path_factory):
    return lone_scene(tmp_path_factory.mktemp("scene"))


def test_a_block_of_no_value_is_neither_in_the_core_nor_in_the_fmu(lone, tmp_path):
    scene, blocks = load(lone), {}
    assert len(scene.interface.nodes) == 0
    for backend in ("in-process", "fmu"):
        with opened(scene, backend, {}, tmp_path) as sides:
            blocks[backend] = dict(sides["structural"].blocks)
    assert blocks["fmu"] == blocks["in-process"]
    assert "displacement" not in blocks["fmu"]
    core = scene.structural_core()
    with pytest.raises(ValueError, match=r"there is no block 'displacement'.*position"):
        core.get("displacement")


def test_it_falls_the_same_with_both_backends_and_leaves_results(lone, tmp_path):
    written = {}
    for backend in ("in-process", "fmu"):
        out = tmp_path / backend
        words = ["run", str(lone), "--backend", backend, "--stop-time", "0.5", "--out", str(out)]
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.output
        written[backend] = (out / "history.csv").read_text()
        assert json.loads((out / "summary.json").read_text())["status"] == "converged"
        assert (out / "interface.csv").read_text().count("\n") == 1  # the header
        assert len((out / "nodes.csv").read_text().splitlines()) == 26
        assert (out / "structure.vtu").exists()
    assert written["fmu"] == written["in-process"]


def test_its_fmu_is_built_with_reference_results(lone, tmp_path):
    result = CliRunner().invoke(app, ["build", str(lone), "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert [p.name for p in tmp_path.glob("[!.]*")] == ["lone_structural.fmu"]


@pytest.mark.parametrize("backend", ["in-process", "fmu"])
def test_its_cells_of_a_comparison_are_solved(lone, backend):
    rows = compare(str(lone), ["explicit", "iqn-ils"], backend=backend, stop_time=0.2, jobs=0)
    assert [row["status"] for row in rows] == ["converged"] * 2, [row["message"] for row in rows]


def test_what_it_does_is_free_fall_at_first(lone, tmp_path):
    with opened(load(lone), "in-process", {}, tmp_path) as sides:
        run = simulate(sides, 0.1, 0.1)
        x = run.blocks["structural"]["position"]
    # held at both ends, along the weight: lines under the middle slacken, those above take part of the weight
    fallen = 150.0 - x[12, 2]
    assert 0.0 < fallen < 0.5 * 9.81 * 0.1**2
    assert np.abs(x[:, :2]).max() < 1e-9  # m, rounding: nothing pushes it aside
