"""A restart after the tables of the scene have changed: a remark where the states still fit, else one refusal."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import scenes
from master.cli import app
from master.commands import opened
from master.coupling import InProcessParticipant, checkpoint
from master.coupling.equilibrium import Coupling
from master.coupling.simulation import exchange_of, simulate
from scenes import load

BACKENDS = ["in-process", "fmu"]


def cli(*words):
    return CliRunner().invoke(app, ["run", *map(str, words)])


def copied(name, folder):
    return shutil.copytree(Path(scenes.__file__).parent / name, Path(folder) / name)


def without_last_segment(scene):
    """The tether with its last segment and node left out, and the end of before fixed."""
    for table in ("lines.csv", "nodes.csv"):
        rows = (scene / table).read_text().splitlines()[:-1]
        rows[-1] += "xyz" if table == "nodes.csv" else ""
        (scene / table).write_text("\n".join(rows) + "\n")
    toml = scene / "scene.toml"
    toml.write_text(toml.read_text().replace(', "segment_24"]', "]"))


@pytest.mark.parametrize("backend", BACKENDS)
def test_tables_with_another_number_of_nodes_are_refused_and_nothing_is_lost(backend, tmp_path):
    scene, out, kept = copied("tether_in_wind", tmp_path), tmp_path / "out", tmp_path / "a.ckp"
    words = [scene, "--backend", backend, "--no-report", "--out", out]
    assert cli(*words, "--stop-time", 0.2, "--checkpoint", kept).exit_code == 0
    without_last_segment(scene)
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    assert len(list((out / "fmus").glob("*.fmu"))) == (2 if backend == "fmu" else 0)
    result = cli(*words, "--stop-time", 0.4, "--restart", kept)
    assert result.exit_code == 2
    assert "the checkpoint does not fit, as the tables" in result.output
    assert "has shape (25, 3) there and shape (24, 3) here" in result.output.replace("\n", " ")
    assert before == {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}


@pytest.mark.parametrize("backend", BACKENDS)
def test_tables_with_other_numbers_are_a_remark_through_time(backend, tmp_path):
    scene, kept = copied("tether_in_wind", tmp_path), tmp_path / "a.ckp"
    words = [scene, "--backend", backend, "--no-report", "--out", tmp_path / "out"]
    assert cli(*words, "--stop-time", 0.2, "--checkpoint", kept).exit_code == 0
    same = cli(*words, "--stop-time", 0.3, "--restart", kept)
    assert "other tables" not in same.output
    toml = scene / "scene.toml"
    toml.write_text(toml.read_text().replace("line_normal_drag = 1.22", "line_normal_drag = 1.0"))
    other = cli(*words, "--stop-time", 0.3, "--restart", kept)
    assert other.exit_code == 0, other.output
    assert "restarted from a.ckp at 0.2 s, with other tables of the scene than then" in other.output


def test_tables_with_other_numbers_are_a_remark_in_a_quasi_static_case(tmp_path):
    scene, kept = copied("typical_section", tmp_path), tmp_path / "a.ckp"
    words = [scene, "--backend", "in-process", "--no-report", "--out", tmp_path / "out"]
    assert cli(*words, "--checkpoint", kept).exit_code == 0
    assert "other tables" not in cli(*words, "--restart", kept).output
    toml = scene / "scene.toml"
    toml.write_text(toml.read_text() + "\n# a word more\n")
    other = cli(*words, "--restart", kept)
    assert other.exit_code == 0, other.output
    assert "with other tables of the scene than then; coupling iterations are counted from 1 again" in other.output


def test_a_checkpoint_of_another_scene_leaves_the_participants_of_an_exchange_as_they_were(tmp_path):
    path = tmp_path / "a.ckp"

    def keep(exchange, scheme, march):
        checkpoint.write(path, {}, checkpoint.dump_march(exchange, scheme, march))

    with opened(load("tether_in_wind"), "in-process", {}, tmp_path) as sides:
        assert simulate(sides, 0.2, 0.1, hold=keep).finished
    sides = {side: InProcessParticipant(core) for side, core in load("v3_kite_dynamic").cores().items()}
    exchange = exchange_of({"aero": sides["aero"], "structural": sides["structural"]}, 0.1)
    before = {(side, b): p.get(b) for side, p in sides.items() for b in p.blocks}
    with pytest.raises(ValueError, match=r"the checkpoint does not fit.*begin without it\.$"):
        checkpoint.load_march(exchange, checkpoint.read(path)[1])
    assert (exchange.time, exchange.evaluations) == (0.0, 0)
    assert all(np.array_equal(sides[side].get(b), values) for (side, b), values in before.items())
    static = Coupling.in_process(load("typical_section"))
    with pytest.raises(ValueError, match="not of a coupled equilibrium"):
        checkpoint.load_search(static, checkpoint.read(path)[1])
