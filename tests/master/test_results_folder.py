"""Results come whole or not at all: nothing of earlier ones, and nothing of others, is lost on the way."""

import json
import logging
import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from typer.testing import CliRunner

import master
from master import compare, couple
from master.cli import app
from master.coupling.participants import private_folder
from master.coupling.participants.private_folder import PREFIX, PrivateFolder, hold, sweep
from master.fmu_coupling.document import Document
from master.report.results_folder import MARKER, ResultsFolder
from tests.master.test_couple import oscillator

RUN = ["run", "tether_in_wind", "--backend", "in-process", "--no-report", "--stop-time", 0.2]
ROOT = Path(master.__file__).parents[1]
NAMES = ("a.csv", "b.csv", "fmus/c.fmu")


def cli(*words):
    return CliRunner().invoke(app, list(map(str, words)))


def contents(folder):
    """Name -> content of all files of a folder, but the marker."""
    files = (p for p in folder.rglob("*") if p.is_file() and p.name != MARKER)
    return {p.relative_to(folder).as_posix(): p.read_text() for p in files}


def written(folder, names, text, **options):
    """Results of these names in a folder."""
    with ResultsFolder(folder, NAMES, **options) as results:
        for name in names:
            (results.path / name).parent.mkdir(exist_ok=True)
            (results.path / name).write_text(text)
        results.place()


def partials(out):
    return sorted(p.name for p in out.parent.glob(f"{out.name}.partial*"))


def test_new_results_take_the_place_of_all_of_the_earlier_ones(tmp_path):
    out = tmp_path / "deep" / "out"
    written(out, NAMES, "first")
    written(out, ["a.csv"], "second")
    assert contents(out) == {"a.csv": "second"}
    assert [p.name for p in out.iterdir() if p.name != MARKER] == ["a.csv"]  # an emptied folder goes too
    assert partials(out) == []


def test_files_of_others_stay_beside_results(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes").mkdir()
    (out / "thesis.tex").write_text("mine")
    written(out, NAMES, "first")
    written(out, ["b.csv"], "second")
    assert contents(out) == {"thesis.tex": "mine", "b.csv": "second"}
    assert (out / "notes").is_dir()


@pytest.mark.parametrize("place", ["new", "changed", "link"])
def test_files_that_are_no_results_are_replaced_by_force_only(place, tmp_path):
    out, other = tmp_path / "out", tmp_path / "other.csv"
    out.mkdir()
    if place == "changed":
        written(out, ["a.csv"], "first")
    if place == "link":
        other.write_text("mine")
        (out / "a.csv").symlink_to(other)
    else:
        (out / "a.csv").write_text("mine")
    with pytest.raises(ValueError, match=r"has files that .*: a\.csv; name another folder, or add --force to replace"):
        written(out, NAMES, "second")
    assert contents(out) == {"a.csv": "mine"}
    assert partials(out) == []
    written(out, NAMES, "second", force=True)
    assert contents(out) == dict.fromkeys(NAMES, "second")
    assert place != "link" or other.read_text() == "mine"


def test_a_result_that_somebody_has_changed_stays_when_the_next_run_does_not_write_it(tmp_path):
    out = tmp_path / "out"
    written(out, ["a.csv", "b.csv"], "first")
    (out / "b.csv").write_text("mine")
    with ResultsFolder(out, ["a.csv"]) as results:
        (results.path / "a.csv").write_text("second")
        results.place()
    assert contents(out) == {"a.csv": "second", "b.csv": "mine"}


def test_files_of_others_that_come_meanwhile_leave_the_results_where_they_are(tmp_path):
    out = tmp_path / "out"
    with ResultsFolder(out, NAMES) as results:
        (results.path / "b.csv").write_text("first")
        out.mkdir()
        (out / "b.csv").write_text("mine")
        with pytest.raises(
            ValueError, match=r"has got a b\.csv of somebody else; the results are in .*out\.partial\.$"
        ):
            results.place()
    assert contents(out) == {"b.csv": "mine"}
    assert contents(tmp_path / "out.partial") == {"b.csv": "first"}


@pytest.mark.parametrize("others", [False, True])
def test_of_two_runs_into_one_folder_the_last_to_finish_has_it_whole(others, tmp_path):
    out = tmp_path / "out"
    if others:
        out.mkdir()
        (out / "mine.txt").write_text("mine")
    with ResultsFolder(out, NAMES) as first, ResultsFolder(out, NAMES) as second:
        assert partials(out) == ["out.partial", "out.partial-2"]
        for results, names in ((first, ["a.csv"]), (second, ["a.csv", "b.csv"])):
            for name in names:
                (results.path / name).write_text(str(names))
        second.place()
        first.place()
    assert contents(out) == {"a.csv": "['a.csv']"} | ({"mine.txt": "mine"} if others else {})
    assert partials(out) == []


def test_many_runs_into_one_folder_leave_one_of_them_whole(tmp_path):
    out = tmp_path / "out"

    def run(number):
        for turn in range(10):
            written(out, NAMES[number % 3 :] if number else NAMES, f"{number} {turn}")

    threads = [threading.Thread(target=run, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = contents(out)
    number = int(next(iter(found.values())).split()[0])
    assert set(found) == set(NAMES[number % 3 :] if number else NAMES)
    assert len(set(found.values())) == 1
    assert partials(out) == []


class Killed(BaseException):
    """As a process that is killed: nothing is cleaned up."""


def killed_while_placing(out, at, monkeypatch):
    """Place results in a folder and die at the operation `at` on files; whether it came to that."""
    done = []

    def dying(operation):
        def tried(*arguments, **options):
            done.append(operation)
            if len(done) == at:
                raise Killed
            return operation(*arguments, **options)

        return tried

    results = ResultsFolder(out, NAMES)
    for name in ("a.csv", "b.csv"):
        (results.path / name).write_text("second")
    with monkeypatch.context() as patched:
        for name in ("rename", "replace", "unlink", "rmdir", "mkdir"):
            patched.setattr(Path, name, dying(getattr(Path, name)))
        patched.setattr(shutil, "rmtree", dying(shutil.rmtree))
        try:
            results.place()
        except Killed:
            return True
        finally:
            results._hold.release()  # as the system does
    return False


@pytest.mark.parametrize("others", [False, True])
def test_a_run_killed_as_it_places_its_results_loses_neither_old_nor_new_ones(others, tmp_path, monkeypatch, caplog):
    for at in range(1, 30):
        out = tmp_path / str(at) / "out"
        written(out, NAMES, "first")
        if others:
            (out / "mine.txt").write_text("mine")
        died = killed_while_placing(out, at, monkeypatch)
        complete = any(json.loads(p.read_text())["state"] == "complete" for p in out.parent.glob(f"*.partial/{MARKER}"))
        caplog.clear()
        with ResultsFolder(out, NAMES):
            pass
        mine = {"mine.txt": "mine"} if others else {}
        new = mine | {"a.csv": "second", "b.csv": "second"}
        old = mine | dict.fromkeys(NAMES, "first")
        assert contents(out) in (old, new)
        assert contents(out) == new or partials(out) == ["out.partial"]
        assert not complete or contents(out) == new
        assert complete == ("has now the whole results of a run that was killed" in caplog.text)
        if not died:
            break
    assert not died
    assert at > 4


def test_what_a_killed_run_left_stays_and_is_named_by_the_next(tmp_path, caplog):
    out = tmp_path / "out"
    for expected in (["out.partial"], ["out.partial", "out.partial-2"]):
        caplog.clear()
        results = ResultsFolder(out, NAMES)
        (results.path / "a.csv").write_text("rows")
        results._hold.release()
        assert partials(out) == expected
    assert f"{tmp_path / 'out.partial'} has what a run that was broken off had written (a.csv); it stays" in caplog.text
    written(out, NAMES, "second")
    assert partials(out) == expected
    assert contents(tmp_path / "out.partial") == {"a.csv": "rows"}


def test_of_a_killed_run_that_had_written_nothing_nothing_stays(tmp_path, caplog):
    out = tmp_path / "out"
    ResultsFolder(out, NAMES)._hold.release()
    assert partials(out) == ["out.partial"]
    written(out, NAMES, "first")
    assert partials(out) == []
    assert not caplog.records


def test_a_folder_that_only_looks_like_one_is_left_alone(tmp_path, caplog):
    out = tmp_path / "out"
    mine = tmp_path / "out.partial"
    mine.mkdir()
    (mine / "x").write_text("mine")
    (tmp_path / "out.partial-2").write_text("mine")
    written(out, NAMES, "first")
    assert (mine / "x").read_text() == "mine"
    assert partials(out) == ["out.partial", "out.partial-2"]
    assert not [r for r in caplog.records if r.levelno >= logging.WARNING]


def test_the_present_folder_is_never_exchanged(tmp_path, monkeypatch):
    out = tmp_path / "out"
    written(out, NAMES, "first")
    monkeypatch.chdir(out)
    before = os.stat(".").st_ino
    written(Path(), ["a.csv"], "second")
    assert os.stat(out).st_ino == before
    assert contents(out) == {"a.csv": "second"}


def test_temporary_folders_go_with_their_owner(tmp_path, monkeypatch):
    monkeypatch.setattr(private_folder.tempfile, "tempdir", str(tmp_path))
    left, foreign = tmp_path / f"{PREFIX}left", tmp_path / "kitecosim_other"
    for folder in (left, foreign):
        folder.mkdir()
        (folder / "x").write_text("")
    (tmp_path / f"{PREFIX}link").symlink_to(foreign)
    with PrivateFolder() as mine, PrivateFolder() as other:
        assert not left.exists()
        assert sweep(tmp_path) == []
        assert hold(mine) is None
        assert {mine, other} <= set(tmp_path.iterdir())
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"{PREFIX}link", "kitecosim_other"]
    assert (foreign / "x").exists()


def bad(command, folder):
    """Words that are refused, of each command, one after the other."""
    (folder / "inputs.csv").write_text("time,wind_speed\n0,6\n0.1,0\n")
    of_run = {
        "restart": ["--restart", folder / "missing.ckp"],
        "checkpoint": ["--checkpoint", "/proc/x.ckp"],
        "inputs": ["--inputs", folder / "inputs.csv"],
        "parameter": ["--set", "wind_speed=-1"],
    }
    return {"run": of_run, "build": {"parameter": ["--set", "wind_speed=-1"]}}[command]


def test_refused_input_takes_nothing_away(tmp_path):
    out = tmp_path / "out"
    for words in (RUN, ["build", "tether_in_wind"]):
        assert cli(*words, "--out", out).exit_code == 0
        before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
        for name, more in bad(words[0], tmp_path).items():
            refused = cli(*words, *more, "--out", out)
            assert refused.exit_code == 2, name
            assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before, name
            assert partials(out) == []


def test_a_coupled_run_that_is_refused_takes_nothing_away(serialising, tmp_path):
    out = tmp_path / "out"
    couple(Document.of(oscillator(), serialising), out, report=False)
    before = contents(out)
    from master.coupling.checkpoint import Files

    for files in (Files(restart=tmp_path / "missing"), Files(Path("/proc/x.ckp"))):
        with pytest.raises(ValueError, match=r"cannot be (read|written)"):
            couple(Document.of(oscillator(), serialising), out, report=False, files=files)
        assert contents(out) == before
    assert partials(out) == []


def test_every_command_refuses_files_of_others_before_anything_runs(serialising, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mine = [
        "nodes.csv",
        "compare.csv",
        "steps.csv",
        "tether_in_wind_aero.fmu",
        "thesis.tex",
        "fmus/tether_in_wind_aero.fmu",
    ]
    (tmp_path / "fmus").mkdir()
    for name in mine:
        (tmp_path / name).write_text("mine")
    for words in (RUN, ["build", "tether_in_wind"], ["compare", "tether_in_wind", "--stop-time", 0.1, "--jobs", 0]):
        refused = cli(*words, "--out", ".")
        assert refused.exit_code == 2
        assert "name another folder, or add --force to replace them" in " ".join(refused.output.split())
    with pytest.raises(ValueError, match=r"steps\.csv; name another folder, or add --force"):
        couple(Document.of(oscillator(), serialising), ".", report=False)
    assert contents(tmp_path) == dict.fromkeys(mine, "mine")
    assert cli(*RUN, "--out", ".", "--force").exit_code == 0
    left = contents(tmp_path)
    assert {name for name in mine if left.get(name) == "mine"} == set(mine) - {"nodes.csv"}


def test_files_of_other_commands_and_builds_stay(tmp_path):
    assert cli("build", "tether_in_wind", "--out", tmp_path).exit_code == 0
    assert cli("build", "typical_section", "--out", tmp_path).exit_code == 0
    compare("tether_in_wind", "explicit", stop_time=0.1, jobs=0, out=tmp_path)
    assert cli(*RUN, "--out", tmp_path).exit_code == 0
    names = {p.name for p in tmp_path.iterdir()}
    assert {"tether_in_wind_aero.fmu", "typical_section_structural.fmu", "compare.csv", "history.csv", "cells"} <= names
    assert cli("build", "tether_in_wind", "--out", tmp_path).exit_code == 0  # its own again


LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))
from master.__main__ import main
main()
"""


def test_a_full_disk_is_named_and_leaves_whole_rows_and_the_earlier_results(tmp_path):
    """A limit on the size of files stands for the disk: the system refuses in the same place."""
    out = tmp_path / "out"
    words = [*RUN[:-1], "1.0", "--scheme", "explicit", "--out", out]
    assert cli(*words).exit_code == 0
    before = contents(out)
    command = [sys.executable, "-c", LIMITED, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 2, done.stderr
    assert f"{tmp_path}/out.partial/history.csv cannot be read or written (file too large)" in done.stderr
    assert f"What was written until then is in {tmp_path}/out.partial." in done.stderr
    assert contents(out) == before
    rows = (tmp_path / "out.partial/history.csv").read_text()
    assert rows.endswith("\n")
    assert before["history.csv"].startswith(rows)


def test_an_interrupt_at_any_moment_is_exit_code_130(tmp_path):
    """From the first import on; what comes before is Python's own start."""
    command = [sys.executable, "-c", INTERRUPTED, *map(str, [*RUN, "--out", tmp_path / "out"])]
    for after in (0.0, 0.1, 0.3, 0.6):
        done = subprocess.run([*command, str(after)], capture_output=True, text=True, check=False, cwd=ROOT)
        assert done.returncode == 130, (after, done.returncode, done.stderr)
        assert "Traceback" not in done.stderr


INTERRUPTED = """
import os, signal, sys, threading, time
after = float(sys.argv.pop())
from master.__main__ import main
def interrupt():
    while "master.cli" not in sys.modules:  # then it is within main, and loads
        time.sleep(0.001)
    time.sleep(after)
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt, daemon=True).start()
main()
time.sleep(5)
"""
