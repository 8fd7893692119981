"""A slice of the random kites of `make stress`; the judge sees what it is to see."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.kite_balance import corner_shares, judged, rows
from benchmarks.kite_stress import SHIPPED, campaign, ended


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Results of the shipped kite."""
    out = tmp_path_factory.mktemp("kite") / "out"
    code, output = ended(["run", SHIPPED, "--backend", "in-process", "--no-report", "--out", out])
    assert code == 0, output
    return out


def test_random_kites_are_in_equilibrium_by_their_files_or_say_that_they_are_not():
    counted, told = campaign(range(6))
    assert not told, "\n".join(told)
    assert counted["right"] + counted["right, and unstable, as was said"] >= 3


def test_the_shipped_kite_is_in_equilibrium_by_its_files(flown):
    assert judged(SHIPPED, flown) == ""


SPOILED = {
    "a node that is 0.1 mm off": ("nodes.csv", 4, "z_m", 1e-4),
    "a rest length": ("elements.csv", 50, "rest_length_m", 1e-4),
    "a tension": ("elements.csv", 50, "tension_N", 1e-3),
    "the load of a panel": ("panels.csv", 4, "load_z_Pa", 0.1),
    "the load of a line": ("line_loads.csv", 4, "load_x_N_per_m", 0.02),
}


@pytest.mark.parametrize("what", SPOILED)
def test_the_judge_sees_what_is_off(what, flown, tmp_path):
    name, row, column, change = SPOILED[what]
    out = Path(shutil.copytree(flown, tmp_path / "out"))
    table = rows(out / name)
    table[row][column] = repr(float(table[row][column]) + change)
    with (out / name).open("w", newline="") as file:
        writer = csv.DictWriter(file, table[0].keys())
        writer.writeheader()
        writer.writerows(table)
    assert judged(SHIPPED, out)


def test_corners_share_a_trapezoid_by_its_widths():
    """N_i over a plane trapezoid of widths a = 2 and b = 1: a corner at the wide end gets (2 a + b) / (6 (a + b))."""
    shares = corner_shares(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.5, 1.0, 0.0], [0.5, 1.0, 0.0]]))
    np.testing.assert_allclose(shares, np.array([5.0, 5.0, 4.0, 4.0]) / 18.0, rtol=1e-14)  # rounding
