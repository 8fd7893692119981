"""What a killed or interrupted run leaves is not taken for results, and what belongs elsewhere says where."""

import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from master import compare, couple
from master.cli import app
from master.coupling import InProcessParticipant, simulate
from master.coupling.checkpoint import Files
from master.fmu_coupling.document import Document
from master.report.record import clear_leftovers
from master.report.results_folder import MARKER
from scenes import load
from tests.master.test_couple import oscillator

TETHER = ["run", "tether_in_wind", "--backend", "in-process", "--no-report", "--stop-time", 0.2]


def contents(folder):
    """Name -> content of all files of a folder."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def cli(*words):
    return CliRunner().invoke(app, list(map(str, words)))


@pytest.fixture(scope="module")
def dead():
    """The number of a process that no longer lives."""
    done = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    return int(done.stdout)


def test_only_files_of_dead_processes_and_of_these_names_are_removed(dead, tmp_path):
    names = [
        f".a.csv.{dead}.tmp",
        f".a.csv.{os.getpid()}.tmp",
        f".b.csv.{dead}.tmp",
        f"a.csv.{dead}.tmp",
        ".a.csv.x.tmp",
    ]
    names += [f".a.csv.{dead}.part", f".a.csv.{10**30}.tmp"]
    for name in names:
        (tmp_path / name).write_text("")
    clear_leftovers(tmp_path, ["a.csv"])
    assert {p.name for p in tmp_path.iterdir()} == set(names) - {names[0], names[5]}
    clear_leftovers(tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == set(names) - {names[0], names[2], names[5]}


def test_every_command_clears_what_killed_runs_left_in_its_folder(dead, serialising, tmp_path):
    places = {
        "run": f".history.csv.{dead}.tmp", "fmu": f"fmus/.tether_in_wind_aero.fmu.{dead}.tmp",
        "couple": f".results.csv.{dead}.tmp", "compare": f".compare.csv.{dead}.tmp",
        "cell": f"cells/.0123abcd.json.{dead}.tmp", "build": f".tether_in_wind_aero.fmu.{dead}.part",
    }  # fmt: skip
    for name in ("fmus", "cells"):
        (tmp_path / name).mkdir()
    for place in places.values():
        (tmp_path / place).write_text("half")
    assert cli(*TETHER, "--out", tmp_path).exit_code == 0
    couple(Document.of(oscillator(), serialising), tmp_path, report=False)
    compare("tether_in_wind", "explicit", stop_time=0.1, jobs=0, out=tmp_path)
    assert cli("build", "tether_in_wind", "--out", tmp_path).exit_code == 0
    assert [p.name for p in tmp_path.rglob(".*")] == [MARKER]


def test_an_interrupted_comparison_leaves_that_before_it_whole(tmp_path):
    compare("tether_in_wind", ["explicit", "aitken"], stop_time=0.1, jobs=0, out=tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    before = contents(tmp_path)
    assert "compare.html" in before

    def interrupt(done, total, row):
        if row is not None:
            raise KeyboardInterrupt

    with pytest.raises(ValueError, match="no scheme 'foo'"):
        compare("tether_in_wind", ["foo"], stop_time=0.1, jobs=0, out=tmp_path)
    assert contents(tmp_path) == before  # bad input takes nothing away
    with pytest.raises(KeyboardInterrupt):
        compare("tether_in_wind", ["iqn-ils"], stop_time=0.2, jobs=0, out=tmp_path, progress=interrupt)
    after = contents(tmp_path)
    assert {name: after[name] for name in before} == before
    assert [name[:6] for name in after if name not in before] == ["cells/"]  # and one finished cell more
    assert sorted(p.name for p in tmp_path.parent.glob(f"{tmp_path.name}.partial*")) == []


def test_checkpoints_of_run_and_couple_say_whose_they_are(serialising, tmp_path):
    of_run, of_couple = tmp_path / "run.ckp", tmp_path / "couple.ckp"
    assert cli(*TETHER, "--checkpoint", of_run, "--out", tmp_path / "a").exit_code == 0
    couple(Document.of(oscillator(stop=0.5), serialising, "trolley.toml"), files=Files(of_couple))
    for scene in ("tether_in_wind", "typical_section"):
        refused = cli("run", scene, "--restart", of_couple, "--out", tmp_path / "b")
        assert refused.exit_code == 2
        assert "couple.ckp is of `kitecosim couple trolley.toml`; continue it with that command." in refused.output
    with pytest.raises(ValueError, match=r"run\.ckp is of `kitecosim run tether_in_wind`; continue it with that comm"):
        couple(Document.of(oscillator(), serialising), files=Files(restart=of_run))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--stop-time", 1e300, "--step", 1e300], "--step 1e+300 s takes more than 1e+06 steps of the integration"),
        (["--stop-time", 1e300, "--step", 1e-300], "--stop-time 1e+300 s takes more than 1e+12 communication steps"),
        (["--stop-time", 1e5, "--step", 1e5], "which are of 0.05 s at most (longest_step); take a shorter one"),
        (["--set", "longest_step=1e-7", "--step", 0.2], "which are of 1e-07 s at most (longest_step)"),
    ],
)
def test_steps_beyond_all_measure_are_refused(words, says, tmp_path):
    refused = cli(*TETHER, *words, "--out", tmp_path)
    assert refused.exit_code == 2
    assert says in refused.output


def test_steps_beyond_all_measure_end_a_run_of_a_script_too():
    sides = {side: InProcessParticipant(core) for side, core in load("tether_in_wind").cores().items()}
    run = simulate(sides, 1e300, 1e300)
    assert run.status == "diverged"
    assert "a step of 1e+300 s takes more than 1e+06 steps of the integration" in run.message
    with pytest.raises(ValueError, match=r"there are more than 1e\+12 steps of 1e-300 s"):
        simulate(sides, 1e300, 1e-300)
