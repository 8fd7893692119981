"""`kitecosim compare`: tables, exit codes, one sentence for bad input, and an interrupt that loses nothing."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

import master.studies.files
from master.cli import app
from master.coupling.schemes import SCHEMES, Kind
from master.report.results_folder import MARKER

ROOT = Path(__file__).parents[2]


def run(out, *arguments):
    return CliRunner().invoke(app, ["compare", *arguments, "--jobs", "0", "--out", str(out)])


def test_command_prints_a_table_a_scene_and_names_its_files(tmp_path):
    first = run(tmp_path, "typical_section", "--sweep", "wind_speed=5,10", "--schemes", "explicit,iqn-ils")
    assert first.exit_code == 0, first.output
    titles = [line.strip() for line in first.stdout.splitlines() if line.startswith("typical_section")]
    assert titles == ["typical_section wind_speed=5", "typical_section wind_speed=10"]
    assert first.stdout.count("iqn-ils") == 2
    named = first.stdout.rpartition("written: ")[2].strip().replace(f"{tmp_path}/", "").split(", ")
    assert sorted([*named, "cells", MARKER]) == sorted(p.name for p in tmp_path.iterdir())
    again = run(tmp_path, "typical_section", "--sweep", "wind_speed=5,10,15", "--schemes", "explicit,iqn-ils")
    assert f"4 of 6 cells were there already, in {tmp_path}/cells" in again.stdout
    assert "there already" not in first.stdout
    for option in ("--recompute", "--fresh"):  # the second is its name in releases up to 0.1
        once_more = run(tmp_path, "typical_section", "--sweep", "wind_speed=5,10", "--schemes", "explicit", option)
        assert once_more.exit_code == 0, once_more.output
        assert "there already" not in once_more.stdout


def test_vectors_are_swept_between_semicolons_and_scenes_have_their_own_settings(tmp_path):
    done = run(
        tmp_path, "typical_section", "v3_hanging_test", "--schemes", "aitken", "--max-iterations", "1",
        "--sweep", "wind_direction=1,0,0;1,0,0.002", "--set", "typical_section.variant=restoring",
    )  # fmt: skip
    assert done.exit_code == 0, done.output  # no flow and no wind in the hangar
    titles = [line.strip() for line in done.stdout.splitlines() if line.startswith(("typical_section", "v3_"))]
    assert titles == [
        "typical_section variant=restoring wind_direction=1,0,0",
        "typical_section variant=restoring wind_direction=1,0,0.002",
        "v3_hanging_test",
    ]


def test_not_converged_ends_with_0_and_a_crash_with_1(tmp_path, monkeypatch):
    assert run(tmp_path, "typical_section", "--max-iterations", "1").exit_code == 0

    class Broken:
        def begin(self, fields):
            raise RuntimeError("a defect")

    monkeypatch.setitem(SCHEMES, "broken", Kind(Broken, {}, "", ""))
    done = run(tmp_path, "typical_section", "--schemes", "broken,aitken")
    assert done.exit_code == 1
    assert "kitecosim: typical_section, broken crashed: RuntimeError: a defect" in done.stderr
    assert "aitken" in done.stdout


WORDS = {
    "scene": (["no_such_scene"], ["no_such_scene", "v3_kite"]),
    "scheme": (["typical_section", "--schemes", "newton"], ["newton", "iqn-ils"]),
    "no scheme": (["typical_section", "--schemes", ","], ["choose from", "iqn-ils"]),
    "backend": (["typical_section", "--backend", "cloud"], ["cloud", "in-process"]),
    "parameter": (["typical_section", "--parameters", "omga=1"], ["omga", "omega0"]),
    "parameter of another scheme": (["typical_section", "--parameters", "aitken.reuse=1"], ["reuse", "omega_max"]),
    "parameter of no scheme": (["typical_section", "--parameters", "newton.omega=1"], ["newton", "iqn-ils"]),
    "parameter of a scheme left out": (
        ["typical_section", "--schemes", "explicit", "--parameters", "aitken.omega=1"], ["aitken", "not compared"],
    ),
    "value of a parameter": (["typical_section", "--parameters", "relaxation.omega=0"], ["omega", "not zero"]),
    "word for a number": (["typical_section", "--parameters", "relaxation.omega=big"], ["omega", "big", "0.25"]),
    "form of a parameter": (["typical_section", "--parameters", "omega"], ["--parameters", "NAME=VALUE"]),
    "value twice": (["typical_section", "--parameters", "relaxation.omega=0.5,0.5"], ["twice"]),
    "name twice": (["typical_section", "--sweep", "wind_speed=5", "--sweep", "wind_speed=6"], ["wind_speed", "in one"]),
    "setting": (["typical_section", "--set", "wind_sped=5"], ["wind_sped", "wind_speed"]),
    "setting of no scene": (["typical_section", "v3_kite", "--set", "wind_sped=5"], ["wind_sped", "kitecosim scenes"]),
    "swept value": (["typical_section", "--sweep", "wind_speed=5,strong"], ["wind_speed", "strong"]),
    "form of a sweep": (["typical_section", "--sweep", "wind_speed=5,,6"], ["--sweep", "NAME=VALUE"]),
    "swept and set": (["typical_section", "--sweep", "wind_speed=5", "--set", "wind_speed=6"], ["wind_speed", "both"]),
    "tolerance": (["typical_section", "--tolerance", "0"], ["--tolerance"]),
    "iterations": (["typical_section", "--max-iterations", "0"], ["--max-iterations"]),
    "repeat": (["typical_section", "--repeat", "0"], ["--repeat"]),
}  # fmt: skip


@pytest.mark.parametrize("wrong", WORDS)
def test_bad_comparison_is_refused_in_one_sentence_before_anything_is_written(wrong, tmp_path):
    arguments, words = WORDS[wrong]
    done = run(tmp_path / "out", *arguments)
    assert done.exit_code == 2, done.output
    (line,) = done.stderr.splitlines()
    assert line.startswith("kitecosim: ")
    assert all(word in line for word in words), line
    assert not (tmp_path / "out").exists()


def test_negative_jobs_and_a_folder_that_is_a_file_are_refused(tmp_path):
    arguments = ["compare", "typical_section", "--jobs", "-1", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, arguments)
    assert (done.exit_code, "--jobs" in done.stderr) == (2, True)
    (tmp_path / "out").write_text("keep me")
    done = run(tmp_path / "out", "typical_section")
    assert (done.exit_code, "--out" in done.stderr) == (2, True)


def test_fmus_give_the_counts_of_the_solvers_in_this_process(tmp_path):
    both = [run(tmp_path / b, "typical_section", "--backend", b, "--schemes", "aitken") for b in ("fmu", "in-process")]
    assert [done.exit_code for done in both] == [0, 0]
    tables = [(tmp_path / b / "residuals.svg").read_bytes() for b in ("fmu", "in-process")]
    assert tables[0] == tables[1]


def test_without_the_libraries_there_are_tables_and_a_remark(tmp_path, monkeypatch):
    run(tmp_path, "typical_section", "--schemes", "aitken")
    monkeypatch.setattr(master.studies.files, "find_spec", lambda name: None)
    done = run(tmp_path, "typical_section", "--schemes", "aitken")
    assert "pip install 'kitecosim[report]'" in done.stdout
    assert sorted(p.name for p in tmp_path.glob("[!.]*")) == ["cells", "compare.csv", "compare.json", "compare.md"]


def test_interrupt_keeps_the_finished_cells_and_ends_with_130(tmp_path):
    command = [sys.executable, "-m", "master", "compare", "typical_section", "v3_kite_detailed", "--jobs", "1"]
    process = subprocess.Popen(
        [*command, "--schemes", "relaxation", "--repeat", "20", "--out", str(tmp_path)],  # some seconds in the second
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True,
    )  # fmt: skip
    until = time.monotonic() + 30.0  # s
    while not list(tmp_path.glob("cells/*.json")) and time.monotonic() < until:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all its processes
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 130, errors
    assert errors.splitlines() == [
        f"kitecosim: interrupted; finished cells are in {tmp_path}/cells, and the same command continues from there; "
        "tables of an earlier comparison stay."
    ]
    assert len(list(tmp_path.glob("cells/*"))) == 1
