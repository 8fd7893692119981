"""A parafoil as flown, judged from the files that a run leaves by arithmetic of its own: forces on every node."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from master.cli import app

PILOT = "pilot"


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The files of a run of parafoil_small: table name -> columns, and summary.json."""
    out = tmp_path_factory.mktemp("parafoil")
    done = CliRunner().invoke(app, ["run", "parafoil_small", "--no-report", "--no-stability", "--out", str(out)])
    assert done.exit_code == 0, done.output
    tables = {}
    for name in ("nodes", "elements", "interface", "panels", "line_loads", "membranes"):
        with (out / f"{name}.csv").open() as file:
            rows = list(csv.DictReader(file))
        tables[name] = {column: [row[column] for row in rows] for column in rows[0]}
    return tables, json.loads((out / "summary.json").read_text())


def numbers(table, *columns):
    return np.array([table[c] for c in columns], dtype=float).T


def placed(flown):
    """Positions (n,3) of the nodes, their rows by name, and the node of the structure (b,) at each of the interface."""
    nodes, surface = flown["nodes"], numbers(flown["interface"], "x_m", "y_m", "z_m")
    x = numbers(nodes, "x_m", "y_m", "z_m")
    apart = np.linalg.norm(surface[:, None] - x[None], axis=2)
    assert apart.min(axis=1).max() < 1e-9  # structure and flow share their nodes
    return x, {name: i for i, name in enumerate(nodes["node"])}, apart.argmin(axis=1)


def of_membranes(flown, x, row):
    """Forces (n,3) of the triangles on their nodes: Cauchy stress across their sides, half a side to each end."""
    t = flown["membranes"]
    corner = np.array([[row[t[f"node_{k}"][i]] for k in (1, 2, 3)] for i in range(len(t["node_1"]))])
    one, two = numbers(t, "cauchy_stress_1_N_per_m", "cauchy_stress_2_N_per_m").T
    along = numbers(t, "direction_x", "direction_y", "direction_z")
    points = x[corner]
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    aside = np.cross(normal, along)
    stress = one[:, None, None] * np.einsum("ei,ej->eij", along, along)
    stress += two[:, None, None] * np.einsum("ei,ej->eij", aside, aside)
    force = np.zeros_like(x)
    for k in range(3):  # the rest of the sheet pulls at the side from corner k to the next
        side = points[:, (k + 1) % 3] - points[:, k]
        pull = np.einsum("eij,ej->ei", stress, np.cross(side, normal))
        for end in (k, (k + 1) % 3):
            np.add.at(force, corner[:, end], -0.5 * pull)
    return force


def of_lines(flown, x, row, surface):
    """Forces (n,3) of the lines on their nodes, tension along them and the wind on them."""
    loads, elements = flown["line_loads"], flown["elements"]
    ends = surface[numbers(loads, "node_1", "node_2").astype(int) - 1]
    assert loads["element"] == elements["element"]
    way = x[ends[:, 1]] - x[ends[:, 0]]
    length = np.linalg.norm(way, axis=1)
    stretch = length / numbers(elements, "rest_length_m")[:, 0] - 1.0
    tension = np.maximum(numbers(elements, "EA_N")[:, 0] * stretch, 0.0)  # slack lines carry nothing
    wind = 0.5 * length[:, None] * numbers(loads, *(f"load_{axis}_N_per_m" for axis in "xyz"))
    force = np.zeros_like(x)
    for end, sign in ((0, 1.0), (1, -1.0)):
        np.add.at(force, ends[:, end], sign * tension[:, None] * way / length[:, None] + wind)
    return force


def of_air(flown, x, surface):
    """Forces (n,3) of the air on the nodes: p a + s |a| of each panel, shared by its bilinear shape (two Gauss points
    a side, exact).
    """
    t = flown["panels"]
    corner = surface[numbers(t, *(f"node_{k}" for k in (1, 2, 3, 4))).astype(int) - 1]
    c = x[corner]
    area = 0.5 * np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1])
    size = np.linalg.norm(area, axis=1)
    load = numbers(t, "exchanged_pressure_Pa") * area
    load = load + size[:, None] * numbers(t, *(f"exchanged_shear_{axis}_Pa" for axis in "xyz"))
    share = np.zeros((len(c), 4))
    at = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    for u in at:
        for v in at:
            n = np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
            along = (1 - v) * (c[:, 1] - c[:, 0]) + v * (c[:, 2] - c[:, 3])
            across = (1 - u) * (c[:, 3] - c[:, 0]) + u * (c[:, 2] - c[:, 1])
            share += 0.25 * np.einsum("pj,pj->p", np.cross(along, across), area)[:, None] * n
    share /= (size**2)[:, None]
    force = np.zeros_like(x)
    np.add.at(force, corner, share[:, :, None] * load[:, None, :])
    return force


def test_every_node_is_in_balance_by_arithmetic_of_its_own(flown):
    tables, summary = flown
    x, row, surface = placed(tables)
    parts = [of_membranes(tables, x, row), of_lines(tables, x, row, surface), of_air(tables, x, surface)]
    left = sum(parts)
    free = np.arange(len(x)) != row[PILOT]
    out = np.linalg.norm(left[free])
    # the loads in the files are those of the shape in them, for which the structure was solved once more or not
    assert out <= 1.5 * summary["residual_N"] + 1e-7
    # without gravity the pilot point holds what air and wind pull
    pull = np.array(summary["outputs"]["support_force"])
    assert left[row[PILOT]] == pytest.approx(pull, abs=1e-6)
    scale = np.linalg.norm(pull)
    assert out <= 1e-3 * scale
    air = parts[2].sum(axis=0) + of_wind(tables, x, surface).sum(axis=0)
    assert np.linalg.norm(air - pull) <= 1e-8 * scale + 2.0 * np.sqrt(len(x)) * summary["residual_N"]


def of_wind(tables, x, surface):
    """The wind on the lines alone (n,3)."""
    loads = tables["line_loads"]
    ends = surface[numbers(loads, "node_1", "node_2").astype(int) - 1]
    length = np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
    wind = 0.5 * length[:, None] * numbers(loads, *(f"load_{axis}_N_per_m" for axis in "xyz"))
    force = np.zeros_like(x)
    for end in (0, 1):
        np.add.at(force, ends[:, end], wind)
    return force


def test_nothing_pitches_the_kite_about_the_pilot_point(flown):
    tables, summary = flown
    x, row, surface = placed(tables)
    force = of_air(tables, x, surface) + of_wind(tables, x, surface)
    arm = x - x[row[PILOT]]
    moment = np.cross(arm, force).sum(axis=0)
    scale = np.linalg.norm(arm, axis=1).max() * np.linalg.norm(force.sum(axis=0))
    # what each free node is out of balance by, times its arm
    assert np.abs(moment).max() <= 2.0 * summary["residual_N"] * np.linalg.norm(arm)
    assert np.abs(moment).max() <= 1e-6 * scale
