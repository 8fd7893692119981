"""Comparisons: every combination is solved once, kept, found again, and told truly, whatever becomes of a cell."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import scenes
from master import compare
from master.coupling import Coupling, solve
from master.coupling.schemes import SCHEMES, Kind
from master.studies.flat import flat_rows
from master.studies.grid import grid
from tests.master.test_report import Page
from tests.scenes.broken import copy_of

ROOT = Path(__file__).parents[2]
TIMES = ("seconds_total", "seconds_structural", "seconds_aero", "seconds_master")
OPTIONS = {"backend": "in-process", "tolerance": 1e-5, "force_tolerance": 0.01, "max_iterations": 200, "repeat": 1}


def without_times(rows):
    return [{k: v for k, v in row.items() if k not in TIMES} for row in rows]


def test_grid_is_the_product_of_scenes_sweep_schemes_and_parameters():
    rows = compare(
        "typical_section",
        ["explicit", "relaxation", "aitken"],
        {"omega": [0.3, 0.6], "aitken.omega_max": 2.0},
        {"wind_speed": [5, 10.0]},
        jobs=0,
    )
    assert [(row["given.wind_speed"], row["label"]) for row in rows] == [
        (wind, label)
        for wind in ("5", "10")
        for label in (
            "explicit",
            "relaxation omega=0.3",
            "relaxation omega=0.6",
            "aitken omega=0.3 omega_max=2",
            "aitken omega=0.6 omega_max=2",
        )
    ]
    assert [row["aero.wind_speed"] for row in rows[:6:5]] == [5.0, 10.0]
    assert len({row["key"] for row in rows}) == len(rows)


def test_cell_is_the_solve_that_a_script_makes_of_it():
    (row,) = compare("v3_kite", "iqn-ils", {"omega0": 0.2}, settings={"wind_speed": 14}, jobs=0)
    scene = scenes.load("v3_kite")
    coupling = Coupling.in_process(scene, {"wind_speed": 14.0})
    result = solve(coupling, SCHEMES["iqn-ils"](omega0=0.2))
    assert (row["status"], row["coupling_iterations"]) == (result.status, result.iterations)
    assert row["calls_structural"] == row["calls_aero"] == coupling.evaluations
    assert row["residual_N"] == result.residual_N
    assert row["residual_history_m"] == [h["residual_m"] for h in result.history]
    assert row["residual_history_N"] == [h["structural.imbalance_before_step"] for h in result.history]
    assert row["CL"] == float(coupling.aero.get("CL"))
    assert row["newton_structural"] == sum(h["structural.newton_iterations"] for h in result.history)
    # all that was in force, whether given or not
    assert row["scheme.omega0"] == 0.2
    assert row["scheme.reuse"] == SCHEMES["iqn-ils"].parameters["reuse"]
    assert row["scene.line_drag"] == "on"
    assert row["structural.gravity"] == 9.81
    assert row["structural.trim_angle"] == scene.trim_angle({"wind_speed": 14.0})
    parts = sum(row[f"seconds_{k}"] for k in ("structural", "aero", "master"))
    assert row["seconds_total"] == pytest.approx(parts, rel=1e-9)  # rounding of a sum


def test_histories_say_what_each_update_used():
    relaxation, aitken, quasi = compare("v3_kite", ["relaxation", "aitken", "iqn-ils"], {"aitken.omega": 0.4}, jobs=0)
    for row in (relaxation, aitken, quasi):
        assert len(row["omega_history"]) == len(row["columns_history"]) == row["coupling_iterations"]
    # no update leads to the first evaluation
    assert relaxation["omega_history"][0] is aitken["omega_history"][0] is None
    assert set(relaxation["omega_history"][1:]) == {0.25}
    assert aitken["omega_history"][1] == 0.4
    r = aitken["residual_history_m"]
    assert len(set(aitken["omega_history"])) > 2
    assert len(r) == aitken["coupling_iterations"]
    # a column a coupling iteration, as long as none is filtered
    used, filtered = quasi["columns_history"][1:], quasi["filtered_history"][1:]
    assert [u + f for u, f in zip(used, filtered, strict=True)] == list(range(len(used)))


def test_other_equilibrium_is_told_from_the_one_that_most_have_found():
    schemes, settings = ["explicit", "relaxation", "aitken", "iqn-ils"], {"wind_speed": 20, "line_drag": "off"}
    rows = compare("v3_kite", schemes, settings=settings, jobs=0)
    explicit, *others = rows
    assert {row["status"] for row in rows} == {"converged"}
    assert explicit["equilibrium"] == 2  # thrown far off, it comes to rest stalled
    assert explicit["tip_span"] < 7.0 < 7.4 < min(row["tip_span"] for row in others)  # m
    assert explicit["CL"] > 0.9  # 0.35 where it flies
    assert explicit["displacement_difference"] > 0.1
    assert [row["equilibrium"] for row in others] == [1] * len(others)
    assert max(row["displacement_difference"] for row in others) < 1e-4


def test_equilibria_of_one_displacement_or_none():
    cells = grid(["typical_section"], ["explicit", "aitken", "iqn-ils"], {}, {}, {}, ["serial"], OPTIONS, {})

    def told(*displacements):
        found = [
            {"status": "diverged" if d is None else "converged", "message": "", "displacement": d, "residual_N": n}
            for n, d in enumerate(displacements)
        ]
        return [row["equilibrium"] for row in flat_rows(cells, found)]

    assert told(None, None, None) == [None, None, None]
    assert told([0.0, 1.0], [0.0, 2.0], [0.0, 2.001]) == [2, 1, 1]  # most of them
    assert told(None, [1.0], [2.0]) == [None, 1, 2]  # one each: that with the smaller force
    assert told([1e-5], [5e-5], [3e-5]) == [1, 1, 1]  # no further apart than the tolerance can tell


def test_workers_find_what_this_process_finds():
    what = ("typical_section", ["explicit", "aitken"], None, {"wind_speed": [10, 20]})
    assert without_times(compare(*what, jobs=2)) == without_times(compare(*what, jobs=0))


def test_not_converged_is_a_result():
    rows = compare("typical_section", ["explicit", "relaxation"], settings={"variant": "restoring", "wind_speed": 25},
                   max_iterations=3, jobs=0)  # fmt: skip
    assert [row["status"] for row in rows] == ["max_iterations", "max_iterations"]
    assert all(row["equilibrium"] is None for row in rows)
    (row,) = compare("typical_section", "explicit", settings={"variant": "restoring", "wind_speed": 25}, jobs=0)
    assert row["status"] == "diverged"
    assert json.dumps(row, allow_nan=False)  # what is not finite is None


def test_second_comparison_solves_nothing_and_a_larger_one_only_what_is_new(tmp_path):
    what = {"scenes": "typical_section", "schemes": ["aitken", "iqn-ils"], "out": tmp_path, "jobs": 0}
    counts = []

    def count(done, total, row):
        counts.append((done, total, row is None))

    first = compare(**what, progress=count)
    assert counts == [(0, 2, True), (1, 2, False), (2, 2, False)]
    files = {path: path.stat().st_mtime_ns for path in (tmp_path / "cells").iterdir()}
    assert len(files) == 2
    counts.clear()
    assert compare(**what, progress=count) == first  # wall times too: nothing was solved
    assert counts == [(2, 2, True)]
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "cells").iterdir()} == files
    counts.clear()
    compare(**what, parameters={"aitken.omega": [0.5, 0.7]}, progress=count)
    assert counts[0] == (2, 3, True)  # omega = 0.5 is the default
    compare(**what, recompute=True)
    assert all(path.stat().st_mtime_ns > before for path, before in files.items())


def test_changed_scene_other_tolerance_or_a_torn_file_is_solved_again(tmp_path):
    folder = copy_of("typical_section", tmp_path)
    there = []

    def progress(done, total, row):
        there.extend([done] if row is None else [])

    def again(**more):
        compare(folder, "aitken", out=tmp_path / "out", jobs=0, progress=progress, **more)

    again()
    again()
    again(tolerance=1e-6)
    (cell, *_) = (tmp_path / "out/cells").iterdir()
    for file in (tmp_path / "out/cells").iterdir():
        file.write_text(cell.read_text()[:100])
    again()
    (folder / "SOURCES.md").write_text("changed")
    again()
    assert there == [0, 1, 0, 0, 0]


def test_same_rows_give_the_same_bytes(tmp_path):
    what = {"scenes": "typical_section", "parameters": {"omega": [0.2, 0.5]}, "out": tmp_path, "jobs": 0}
    compare(**what)
    files = [p for p in tmp_path.iterdir() if p.is_file()]
    assert {"compare.csv", "compare.json", "compare.md", "compare.html", "residuals.png", "iterations.svg"} <= {
        p.name for p in files
    }
    before = {p.name: p.read_bytes() for p in files}
    compare(**what)
    assert {p.name: p.read_bytes() for p in files} == before
    compare(**what, fresh=True)  # its name in releases up to 0.1
    for name in ("residuals.png", "residuals.svg", "iterations.png", "iterations.svg", "omega.png"):
        assert (tmp_path / name).read_bytes() == before[name], name  # no wall times in them


def test_files_hold_what_the_rows_say(tmp_path):
    rows = compare("typical_section", ["explicit", "iqn-ils"], sweep={"wind_speed": [10, 20]}, out=tmp_path, jobs=0)
    assert json.loads((tmp_path / "compare.json").read_text())["cells"] == rows
    with (tmp_path / "compare.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [float(line["residual_m"]) for line in table] == [row["residual_m"] for row in rows]
    assert [line["scheme.reuse"] for line in table] == ["", "10", "", "10"]
    header, _, *lines = (tmp_path / "compare.md").read_text().splitlines()[:4]
    assert header == "| scene | explicit | iqn-ils |"
    counts = [[int(cell.split("/")[0]) for cell in line.strip("| ").split("|")[1:]] for line in lines]
    assert counts == np.reshape([row["coupling_iterations"] for row in rows], (2, 2)).tolist()
    page = (tmp_path / "compare.html").read_text()
    assert all(
        address.startswith("data:image/svg+xml;base64,") for address in Page(page).addresses
    )  # and all is closed
    for outside in ("http://", "https://", "url(", "@import", "<script", "<link"):
        assert outside not in page
    settings = [k for k in rows[1] if k.startswith(("scheme.", "aero.", "structural.", "scene."))]
    assert len(settings) > 10
    for name in settings:
        assert f'<th scope="row">{name}</th>' in page


def test_scheme_without_the_derivatives_that_it_needs_is_unavailable(monkeypatch):
    def refuse(self):
        raise ValueError("the aero solver offers no directional derivatives.")

    monkeypatch.setattr(Coupling, "require_derivatives", refuse)
    (row,) = compare("typical_section", "newton-krylov", jobs=0)
    assert row["status"] == "unavailable"
    assert row["message"] == "the aero solver offers no directional derivatives."
    assert row["seconds_total"] is row["coupling_iterations"] is None
    with pytest.raises(ValueError, match="--backend in-process"):
        compare("typical_section", "newton-krylov", backend="fmu", jobs=0)


class Fails:
    """A scheme with a defect."""

    def begin(self, fields): ...

    def step(self, x, r):
        raise KeyError("no such column")

    def end(self, status, x, r): ...


def test_defect_of_a_scheme_is_the_end_of_its_cell_only(tmp_path, monkeypatch):
    monkeypatch.setitem(SCHEMES, "broken", Kind(Fails, {}, "", ""))
    rows = compare("typical_section", ["broken", "aitken"], out=tmp_path, jobs=0)
    assert [row["status"] for row in rows] == ["crashed", "converged"]
    assert rows[0]["message"] == "KeyError: 'no such column'"
    assert len(list((tmp_path / "cells").iterdir())) == 1  # what crashed is tried again
    assert "crashed" in (tmp_path / "compare.md").read_text()


SCRIPT = """
import os
from master import compare
from master.coupling.acceleration import ConstantRelaxation
from master.coupling.schemes import SCHEMES, Kind

class Deadly(ConstantRelaxation):
    def step(self, x, r):
        os._exit(3)

SCHEMES["deadly"] = Kind(Deadly, {}, "", "ends its process")
"""


def test_death_of_a_worker_is_the_end_of_its_cell_only(tmp_path):
    script = tmp_path / "script.py"
    what = "compare('typical_section', ['explicit', 'deadly', 'aitken'], sweep={'wind_speed': [5, 10]}, jobs=2)"
    script.write_text(f"{SCRIPT}\nif __name__ == '__main__':\n    print([row['status'] for row in {what}])\n")
    done = subprocess.run([sys.executable, script], cwd=ROOT, env=_env(), capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(["converged", "crashed", "converged"] * 2)


def test_script_without_the_guard_is_told_so(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("from master import compare\nprint(compare('typical_section', 'aitken', jobs=1))\n")
    done = subprocess.run([sys.executable, script], cwd=ROOT, env=_env(), capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "`if __name__ == '__main__':`" in done.stderr.splitlines()[-1]


def _env():
    import os

    return {**os.environ, "PYTHONPATH": str(ROOT)}
