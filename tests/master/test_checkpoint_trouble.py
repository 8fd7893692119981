"""Checkpoints that cannot be written cost a remark and no result; those of an earlier run do not stay."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from interface import StepFailed
from master import couple
from master.cli import app
from master.coupling import InProcessParticipant, checkpoint, simulate
from master.coupling.checkpoint import Files
from master.fmu_coupling.document import Document
from master.restart import StepCheckpointWriter
from scenes import load
from tests.master.test_couple import oscillator

COMMANDS = {
    "quasi-static": ["run", "typical_section", "--backend", "in-process"],
    "transient": ["run", "tether_in_wind", "--backend", "in-process", "--stop-time", "0.5"],
}


def cli(*words):
    return CliRunner().invoke(app, list(map(str, words)))


def full(monkeypatch, after):
    """A disk with room for so many checkpoints."""
    write, count = checkpoint.write, []

    def tried(path, about, content):
        count.append(path)
        if len(count) > after:
            raise ValueError(f"checkpoint {path} cannot be written (no space left on device).")
        write(path, about, content)

    monkeypatch.setattr(checkpoint, "write", tried)


@pytest.mark.parametrize("case", COMMANDS)
def test_a_run_goes_on_without_its_checkpoint_and_says_so_once(case, tmp_path, monkeypatch):
    full(monkeypatch, 2)
    kept, out = tmp_path / "a.ckp", tmp_path / "out"
    result = cli(*COMMANDS[case], "--no-report", "--checkpoint", kept, "--out", out)
    assert result.exit_code == 0, result.output
    content = json.loads((out / "summary.json").read_text())
    assert content["status"] == "converged"
    where = {"quasi-static": "before coupling iteration 3", "transient": "at 0.3 s"}[case]
    said = f"no checkpoint {where}: checkpoint {kept} cannot be written (no space left on device); the run went on"
    assert [remark for remark in content["remarks"] if "no checkpoint" in remark] == [f"{said} without it"]
    assert kept.exists()  # the last that could be written


def test_a_folder_that_goes_away_costs_couple_no_result(serialising, tmp_path):
    kept = tmp_path / "gone" / "a.ckp"
    kept.parent.mkdir()

    def follow(number, time, residual, values):
        if number == 3:
            kept.unlink()
            kept.parent.rmdir()

    document = Document.of(oscillator(), serialising)
    result = couple(document, tmp_path / "out", report=False, follow=follow, files=Files(kept))
    assert result.status == "converged"
    assert result.remarks == [
        f"no checkpoint at 0.3 s: checkpoint {kept} cannot be written (no such file or directory); the run went on "
        "without it"
    ]
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["remarks"] == result.remarks


@pytest.mark.parametrize("case", COMMANDS)
def test_a_place_that_takes_no_file_is_refused_before_anything_is_lost(case, serialising, tmp_path):
    kept, out = tmp_path / ("a" * 251 + ".ckp"), tmp_path / "out"  # 255 bytes with no room for the name on the way
    out.mkdir()
    (out / "summary.json").write_text("{}")
    result = cli(*COMMANDS[case], "--checkpoint", kept, "--out", out)
    assert result.exit_code == 2
    assert "cannot be written (file name too long)." in result.output
    with pytest.raises(ValueError, match=r"cannot be written \(file name too long\)\.$"):
        couple(Document.of(oscillator(), serialising), out, files=Files(kept))
    assert [p.name for p in out.iterdir()] == ["summary.json"]


class Forgetful(InProcessParticipant):
    """A structure that can save its state so many times."""

    left = 4

    def save(self):
        self.left -= 1
        if self.left < 0:
            raise RuntimeError("no memory left")
        return super().save()


@pytest.mark.parametrize("scheme", ["explicit", "iqn-ils"])
def test_a_participant_that_cannot_save_ends_the_run_with_a_status(scheme, tmp_path):
    cores = load("tether_in_wind").cores()
    sides = {"aero": InProcessParticipant(cores["aero"]), "structural": Forgetful(cores["structural"])}
    writer = StepCheckpointWriter(Files(tmp_path / "a.ckp"), 1.0, {})
    run = simulate(sides, 1.0, 0.1, scheme, hold=writer)
    assert run.status == "diverged"
    assert "participant structural could not save its state: no memory left" in run.message
    assert len(run.steps) == 2
    assert run.time == pytest.approx(0.2, abs=1e-12)
    assert checkpoint.read(tmp_path / "a.ckp")[0]["steps"] == 2
    assert np.all(np.isfinite(run.blocks["structural"]["position"]))


def test_a_step_failed_in_what_follows_a_march_ends_it_with_a_status():
    def follower(time, run):
        if time > 0.25:
            raise StepFailed("the follower has seen enough")

    cores = load("tether_in_wind").cores()
    run = simulate({s: InProcessParticipant(c) for s, c in cores.items()}, 1.0, 0.1, follower=follower)
    assert (run.status, len(run.steps)) == ("diverged", 3)
    assert run.message == "After communication step 3, at 0.3 s: the follower has seen enough."


def gone(folder, step=0.5):
    """Options with which all of the tether, 300 m, is reeled in within the first communication step: at 999 m/s where a
    run begins, at half of that on average where it continues, as the rate is ramped from nothing.
    """
    table = folder / "inputs.csv"
    table.write_text("time,tether_length_rate\n0,-999\n")
    return ["--inputs", table, "--step", step]


@pytest.mark.parametrize("fails", [False, True])
def test_the_checkpoint_of_an_earlier_run_goes_when_another_begins(fails, tmp_path):
    kept = tmp_path / "a.ckp"
    words = [*COMMANDS["transient"], "--no-report", "--checkpoint", kept]
    assert cli(*words, "--out", tmp_path / "a").exit_code == 0
    bad = gone(tmp_path) if fails else ["--set", "no_such_thing=1"]
    result = cli(*words, *bad, "--out", tmp_path / "b")
    assert result.exit_code == (1 if fails else 2), result.output
    assert kept.exists() != fails  # bad input leaves it where it is
    earlier = tmp_path / "a.ckp.earlier"
    assert earlier.exists() == fails  # a run that fails before its first checkpoint has put it aside
    if fails:
        assert cli(*words, "--restart", earlier, "--out", tmp_path / "c").exit_code == 0
        assert not earlier.exists()  # as there is a newer one


def test_the_checkpoint_that_a_run_continues_from_stays_until_the_next(tmp_path):
    kept = tmp_path / "a.ckp"
    words = [*COMMANDS["transient"][:-2], "--no-report", "--checkpoint", kept, "--out", tmp_path / "out"]
    assert cli(*words, "--stop-time", 0.2).exit_code == 0
    before = kept.read_bytes()
    assert cli(*words, "--restart", kept, "--stop-time", 1.2, *gone(tmp_path, 1.0)).exit_code == 1
    assert kept.read_bytes() == before


def test_a_restart_with_nothing_left_to_do_writes_its_checkpoint(serialising, tmp_path):
    first, second = tmp_path / "a.ckp", tmp_path / "b.ckp"
    words = [*COMMANDS["transient"], "--no-report", "--out", tmp_path / "out"]
    assert cli(*words, "--checkpoint", first).exit_code == 0
    again = cli(*words, "--restart", first, "--checkpoint", second, "--checkpoint-every", 7)
    assert again.exit_code == 0, again.output
    assert checkpoint.head(second)["steps"] == 5
    couple(Document.of(oscillator(), serialising), files=Files(tmp_path / "c.ckp"))
    again = couple(Document.of(oscillator(), serialising), files=Files(second, 7, tmp_path / "c.ckp"))
    assert again.status == "converged"
    assert checkpoint.head(second)["steps"] == 10


@pytest.mark.parametrize("error", [StepFailed("the flow gave up"), RuntimeError("the flow gave up")])
def test_what_a_run_cannot_make_a_record_of_is_one_sentence(error, monkeypatch):
    def fail(*arguments):
        raise error

    monkeypatch.setattr("master.commands.run_scene", fail)
    result = cli("run", "typical_section")
    assert (result.exit_code, result.output) == (1, "kitecosim: the flow gave up\n")


@pytest.mark.parametrize("scene", ["typical_section", "tether_in_wind"])
def test_bad_input_leaves_the_fmus_of_the_run_before_with_its_results(scene, tmp_path):
    out, words = tmp_path / "out", ["run", scene, "--no-report", "--out", tmp_path / "out"]
    words += [] if scene == "typical_section" else ["--stop-time", 0.2]
    assert cli(*words, "--checkpoint", tmp_path / "a.ckp").exit_code == 0
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    assert len(list((out / "fmus").iterdir())) == 2
    (tmp_path / "b.ckp").write_bytes((tmp_path / "a.ckp").read_bytes()[:-9])
    for bad in ("b.ckp", "missing.ckp"):
        result = cli(*words, "--set", "wind_speed=7", "--restart", tmp_path / bad)
        assert result.exit_code == 2
        assert before == {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    assert cli(*words, "--set", "wind_speed=7").exit_code == 0
    assert all(p.read_bytes() != before[p] for p in (out / "fmus").glob("*_aero.fmu"))
    assert cli(*words, "--backend", "in-process").exit_code == 0
    assert not list(out.glob("fmus/*"))
