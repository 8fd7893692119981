"""Checkpoint files: whole or not there, refused in one sentence where they do not fit."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import master
from benchmarks.problems import in_process
from master import restart
from master.cli import app
from master.coupling import SCHEMES, checkpoint, kept, scheme, solve
from master.coupling.acceleration import IQNILS
from master.coupling.march import march
from tests.master.kept_runs import Interrupted, about, begun
from tests.master.test_march_restart import DT, alive, oscillator

ROOT = Path(master.__file__).parents[1]


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda raw: raw[: len(raw) // 2], "damaged"),
        (lambda raw: raw[:30], "damaged"),
        (lambda raw: raw[:10], "not a checkpoint"),
        (lambda raw: b"", "not a checkpoint"),
        (lambda raw: raw[:-1], "damaged"),
        (lambda raw: raw[:-9] + bytes([raw[-9] ^ 1]) + raw[-8:], "damaged"),
        (lambda raw: raw.replace(b'"scene"', b'"scene', 1), "damaged"),
        (lambda raw: checkpoint.MAGIC + b"[1, 2]\n" + raw, "damaged"),
        (lambda raw: checkpoint.MAGIC + b"null\n", "damaged"),
        (lambda raw: checkpoint.MAGIC + b"{}\n", "damaged"),
        (lambda raw: checkpoint.MAGIC + b"\xff\xfe\n", "damaged"),
        (lambda raw: b"PK\x03\x04" + raw, "not a checkpoint"),
        (lambda raw: raw.replace(b"checkpoint 4", b"checkpoint 3", 1), "was written by another version of kitecosim"),
    ],
)
def test_damaged_and_foreign_files_are_refused_in_one_sentence(spoil, says, tmp_path):
    path = tmp_path / "kept.checkpoint"
    with pytest.raises(Interrupted):
        begun("section", path, 1)
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(ValueError, match=says + r".*\.$") as caught:
        checkpoint.read(path)
    assert "\n" not in str(caught.value)


def test_a_folder_a_missing_file_and_another_scene_are_refused_in_one_sentence(tmp_path):
    for path in (tmp_path, tmp_path / "none"):
        with pytest.raises(ValueError, match=r"cannot be read.*\.$"):
            checkpoint.read(path)
    path = tmp_path / "kept.checkpoint"
    with pytest.raises(Interrupted):
        begun("section", path, 1)
    coupling = in_process("v3_kite")
    with pytest.raises(ValueError, match=r"is of scene typical_section.*\.$"):
        restart.resumed(path, coupling, IQNILS(), about("kite", coupling), {})
    coupling = in_process("typical_section")
    other = about("section", coupling, scene_settings={"variant": "restoring"})
    with pytest.raises(ValueError, match=r"has variant = .*, this run restoring.*\.$"):
        restart.resumed(path, coupling, IQNILS(), other, {})


def test_a_state_that_cannot_be_written_is_refused_and_leaves_neither_file_nor_saved_state(tmp_path):
    exchange = oscillator()

    def no(state):
        raise ValueError("its state cannot be written to a file.")

    exchange.participants["mass"].serialised = no
    with pytest.raises(ValueError, match=r"cannot be written.*\.$"):
        march(exchange, IQNILS(), DT, hold=lambda now: checkpoint.write(
            tmp_path / "x", {}, checkpoint.dump_march(exchange, None, now)
        ))  # fmt: skip
    assert alive(exchange) == 0
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_takes_no_file_is_refused_in_one_sentence(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "none" / "x", tmp_path / "folder", tmp_path / "file" / "x"):
        with pytest.raises(ValueError, match=r"cannot be written \(.*\)\.$"):
            checkpoint.write(path, {}, {})
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def test_nothing_half_written_is_ever_at_its_place(tmp_path, monkeypatch):
    path = tmp_path / "kept.checkpoint"
    checkpoint.write(path, {"step": 1}, {"x": np.arange(3.0)})
    write_bytes = Path.write_bytes

    def killed(self, data):
        write_bytes(self, data[: len(data) // 2])
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_bytes", killed)
    with pytest.raises(KeyboardInterrupt):
        checkpoint.write(path, {"step": 2}, {"x": np.arange(4.0)})
    monkeypatch.undo()
    about_, content = checkpoint.read(path)
    assert about_ == {"step": 1}
    assert np.array_equal(content["x"], np.arange(3.0))
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


KILLED = """
import os, sys
from pathlib import Path
from fmus.builder import archive
from master import commands, restart
from master.coupling import checkpoint
write_bytes = Path.write_bytes
checkpoint.write(sys.argv[1], {"step": 1}, {"x": 1})
def die(self, data):
    write_bytes(self, data[:60])
    os._exit(9)
Path.write_bytes = die
checkpoint.write(sys.argv[1], {"step": 2}, {"x": 2})
"""


def test_a_process_that_dies_while_it_writes_leaves_the_checkpoint_before(tmp_path):
    path = tmp_path / "kept.checkpoint"
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], cwd=ROOT, check=False, timeout=60)
    assert done.returncode == 9
    assert checkpoint.read(path) == ({"step": 1}, {"x": 1})
    checkpoint.write(path, {"step": 3}, {"x": 3})  # and the rest of it is no obstacle
    assert checkpoint.read(path)[1] == {"x": 3}
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_people_can_read_the_second_line(tmp_path):
    path = tmp_path / "kept.checkpoint"
    with pytest.raises(Interrupted):
        begun("section", path, 2)
    head = json.loads(path.read_bytes().split(b"\n")[1])
    assert head["scene"] == "typical_section"
    assert head["coupling_iterations"] == 2
    assert head["status"] == "under way"


def test_every_scheme_can_be_kept_with_its_history():
    assert set(SCHEMES) == {"explicit", "relaxation", "aitken", "iqn-ils", "iqn-imvj", "newton-krylov"}
    coupling = in_process("typical_section", wind_speed=15.0)
    for name in SCHEMES:
        used = scheme(name, coupling)
        solve(coupling, used, max_iterations=5)
        twin = kept.loads(kept.dumps({"scheme": used}))["scheme"]
        assert type(twin) is type(used)
        assert kept.dumps({"scheme": twin}) == kept.dumps({"scheme": used})


def crafted(path, change):
    """A checkpoint whose content somebody has changed, with the right SHA-256."""
    about, content = checkpoint.read(path)
    about = json.loads(path.read_bytes().split(b"\n")[1])
    about.pop("sha256")
    change(about, content)
    checkpoint.write(path, about, content)


CHANGES = {
    "head": lambda about, content: about.update(scene_settings=[1]),
    "time": lambda about, content: about.update(coupling_iterations="many"),
    "parameters": lambda about, content: about.update(parameters=5),
    "scheme": lambda about, content: about.update(scheme=["x"]),
    "states": lambda about, content: content["participants"].update(states={"structural": b"x", "aero": b""}),
    "clock": lambda about, content: content["participants"].update(clock="noon"),
    "blocks": lambda about, content: content["participants"].update(blocks=3),
    "search": lambda about, content: content.update(search={"x": 1}),
    "unknowns": lambda about, content: setattr(content["search"], "x", np.zeros(3)),
    "order": lambda about, content: setattr(content["search"], "order", 7),
    "nothing": lambda about, content: content.clear(),
    "best": lambda about, content: content.update(best={"states": {"structural": b"PK"}, "clock": None}),
    "class": lambda about, content: content.update(search=kept.Kept("subprocess:Popen", {"args": "x"})),
}


@pytest.mark.parametrize("change", CHANGES)
def test_crafted_checkpoints_are_refused_in_one_sentence_and_run_nothing(change, tmp_path):
    path, out = tmp_path / "kept.checkpoint", tmp_path / "out"
    words = ["run", "typical_section", "--backend", "in-process", "--no-report", "--out", str(out)]
    assert CliRunner().invoke(app, [*words, "--checkpoint", str(path)]).exit_code == 0
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    crafted(path, CHANGES[change])
    refused = CliRunner().invoke(app, [*words, "--restart", str(path)])
    assert refused.exit_code == 2, refused.output
    assert isinstance(refused.exception, SystemExit), refused.exception
    assert len(refused.output.strip().splitlines()) == 1
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before


def test_an_object_of_another_package_never_comes_of_a_checkpoint():
    for kind in ("subprocess:Popen", "tempfile:_TemporaryFileCloser", "master.cli:typer", "master:IQNILS"):
        with pytest.raises(ValueError, match="there is no class"):
            kept.loads(kept.dumps(kept.Kept(kind, {})))
