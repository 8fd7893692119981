"""A slice of the random motions of `make stress`; the judge sees what it is to see."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.kite_balance import rows
from benchmarks.kite_stress import ended
from benchmarks.motion_balance import judged
from benchmarks.motion_stress import campaign
from benchmarks.random_motions import random_motion


@pytest.mark.parametrize("kind", ["springs", "reels", "wind", "slack"])
def test_random_motions_obey_mechanics_by_their_files_or_say_that_they_do_not(kind):
    counted, told, runs = campaign(kind, range(2))
    assert not told, "\n".join(told)
    assert counted.total() == 2
    assert runs >= 2
    assert counted["right"] >= (1 if kind == "slack" else 2)


@pytest.fixture(scope="module")
def swung(tmp_path_factory):
    """A scene of springs and its runs with three step sizes."""
    folder = tmp_path_factory.mktemp("swung")
    given, outs = random_motion("springs", np.random.default_rng(3), folder / "scene"), []
    for k in range(3):
        step = repr(given["step"] / 2**k)
        outs.append(folder / f"out_{k}")
        words = ["--backend", "in-process", "--no-report", "--step", step, "--set", f"longest_step={step}"]
        code, output = ended(["run", folder / "scene", "--out", outs[-1], *words])
        assert code == 0, output
    return folder / "scene", outs, given["order"]


def test_the_judge_agrees_with_what_is_right(swung):
    scene, outs, order = swung
    assert judged(scene, outs, False, True, order) == ""


SPOILED = {
    "energy": ("history.csv", "kinetic_energy", 1e-6),
    "work": ("history.csv", "external_work", 1e-6),
    "stretch": ("elements.csv", "rest_length_m", 1e-6),
    "tension": ("elements.csv", "tension_N", 1e-6),
}


@pytest.mark.parametrize("what", SPOILED)
def test_the_judge_sees_what_is_off(what, swung, tmp_path):
    scene, outs, order = swung
    name, column, part = SPOILED[what]
    spoiled = _rewritten(outs[1], tmp_path, name, {column: 1.0 + part}, last=True)
    assert judged(scene, [outs[0], spoiled, outs[2]], False, True, order)


def test_the_judge_sees_forces_that_do_not_move_and_another_order(swung, tmp_path):
    scene, outs, order = swung
    pushed = [
        _rewritten(out, tmp_path / str(k), "history.csv", {"support_force[1]": 2.0, "support_force[3]": 0.5})
        for k, out in enumerate(outs)
    ]
    assert "momentum" in judged(scene, pushed, False, True, order)
    assert "of order" in judged(scene, outs, False, True, 3 - order)


def _rewritten(out, folder, name, factors, last=False):
    """A copy of results with columns of a table multiplied, in the last row or in all."""
    copy = Path(shutil.copytree(out, folder / out.name))
    table = rows(copy / name)
    for row in table[-1:] if last else table:
        for column, factor in factors.items():
            row[column] = repr(float(row[column]) * factor)
    with (copy / name).open("w", newline="") as file:
        writer = csv.DictWriter(file, table[0].keys())
        writer.writeheader()
        writer.writerows(table)
    return copy
